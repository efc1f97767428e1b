#!/usr/bin/python3
"""The recording of a mapping drive holds the camera's mount, which is latched and comes before simulated time begins."""
import os
import time
import unittest

import rosbag
import rosnode
import rospy
import rostest
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage


class MappingRecorder(unittest.TestCase):
    def test_recording_holds_the_mount_from_before_the_first_stamp(self):
        path = rospy.get_param("/mapping_recorder/bag")
        if os.path.exists(path):  # of a run that was stopped
            os.remove(path)
        mount = TransformStamped()
        mount.header.frame_id, mount.child_frame_id = "base_link", "camera_link"
        mount.transform.translation.x, mount.transform.rotation.w = 0.05, 1.0
        static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        static.publish(TFMessage([mount]))
        self.wait(lambda: static.get_num_connections() > 0)
        time.sleep(0.5)  # the recorder takes it while time is still 0
        clock = rospy.Publisher("/clock", Clock, queue_size=10)
        odometry = rospy.Publisher("odom", Odometry, queue_size=10)
        self.wait(lambda: clock.get_num_connections() > 0 and odometry.get_num_connections() > 0)
        for i in range(40):
            stamp = rospy.Time(100 + 0.05 * i)
            clock.publish(Clock(stamp))
            message = Odometry()
            message.header.stamp = stamp
            odometry.publish(message)
            time.sleep(0.05)
        rosnode.kill_nodes(["/mapping_recorder"])
        self.wait(lambda: os.path.exists(path))
        try:
            with rosbag.Bag(path) as bag:
                self.assertGreater(bag.get_message_count("/odom"), 5)
                recorded = [m for _, m, _ in bag.read_messages(topics=["/tf_static"])]
                self.assertEqual([t.child_frame_id for m in recorded for t in m.transforms], ["camera_link"])
        finally:
            os.remove(path)

    def wait(self, condition):
        deadline_s = time.monotonic() + 20
        while not condition():
            self.assertLess(time.monotonic(), deadline_s, "waited for 20 s")
            time.sleep(0.05)


if __name__ == "__main__":
    rospy.init_node("test_mapping_recorder")
    rostest.rosrun("kinect_nav", "mapping_recorder", MappingRecorder)
