#!/usr/bin/python3
"""simulation.launch via:=openni2: the images of the simulated Kinect come through the OpenNI2 driver, truly stamped,
and survive an unplugging on command."""
import math
import sys
import unittest

import rospy
import rostest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image, Range
from std_srvs.srv import SetBool


def depth_m(image, column, row):
    at = row * image.step + 2 * column
    return int.from_bytes(image.data[at:at + 2], "little") / 1000.0


class OpenNI2Simulation(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.images, cls.truth = [], []
        cls.subscribers = [rospy.Subscriber("camera/depth/image_raw", Image, cls.images.append),
                           rospy.Subscriber("ground_truth", Odometry, cls.truth.append)]

    def wait(self, condition, seconds, what):
        for _ in range(int(seconds / 0.02)):
            if condition():
                return
            rospy.rostime.wallsleep(0.02)
        self.fail(what)

    def test_1_images_come_from_the_driver(self):
        self.wait(lambda: len(self.images) > 20, 40.0, "no depth images")
        info = rospy.wait_for_message("camera/depth/camera_info", CameraInfo, 10.0)
        self.assertAlmostEqual(info.K[0], 585.0, delta=0.01)
        # The wall ahead is as far as the simulator's range finder says.
        distance = rospy.wait_for_message("range", Range, 10.0)
        self.assertAlmostEqual(depth_m(self.images[-1], 319, 239), distance.range, delta=0.005)

    def test_2_infrared_too(self):
        image = rospy.wait_for_message("camera/ir/image", Image, 20.0)
        self.assertEqual((image.encoding, image.width, image.height), ("mono16", 640, 480))
        self.assertTrue(any(image.data))

    def test_3_stamps_are_those_of_the_simulator(self):
        # Driving at the wall, depth ahead falls by what the robot has moved: a wrong stamp shows as a wrong distance.
        command = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        twist = Twist()
        twist.linear.x = 0.5
        del self.images[:]
        for _ in range(60):
            command.publish(twist)
            rospy.rostime.wallsleep(0.05)
        command.publish(Twist())
        truth = [(t.header.stamp.to_sec(), t.pose.pose.position.x, t.twist.twist.linear.x) for t in list(self.truth)]
        errors = []
        for image in list(self.images):
            stamp = image.header.stamp.to_sec()
            for (t0, x0, v), (t1, x1, _) in zip(truth, truth[1:]):
                if t0 <= stamp < t1 and v > 0.4:
                    x = x0 + (x1 - x0) * (stamp - t0) / (t1 - t0)
                    # flat_wall.yaml: the camera is 0.05 m ahead of base_link, the wall's face at x = 5 m.
                    errors.append((depth_m(image, 319, 239) - (4.95 - x)) / v)
        self.assertGreater(len(errors), 20)
        errors.sort()
        middle = errors[len(errors) // 2]
        print(f"stamp error: median {1000 * middle:.1f} ms, "
              f"5 to 95 % {1000 * errors[len(errors) // 20]:.1f} to {1000 * errors[-len(errors) // 20]:.1f} ms, "
              f"{len(errors)} frames", file=sys.stderr)
        # Of the middle row, which the simulator stamps; a third of a frame period.
        self.assertLess(abs(middle), 0.011)
        for error in errors[len(errors) // 20:-len(errors) // 20]:
            self.assertLess(abs(error - middle), 0.02)

    def test_4_unplugged_on_command_it_comes_back(self):
        plug = rospy.ServiceProxy("simulator/set_plugged", SetBool)
        self.assertTrue(plug(False).success)
        rospy.rostime.wallsleep(0.5)
        del self.images[:]
        rospy.rostime.wallsleep(1.0)
        self.assertEqual(len(self.images), 0, "the simulator publishes images itself")
        self.assertTrue(plug(True).success)
        self.wait(lambda: len(self.images) > 3, 3.0, "not back within 3 s")
        self.assertTrue(math.isfinite(depth_m(self.images[-1], 319, 239)))


if __name__ == "__main__":
    rospy.init_node("test_openni2_simulation")
    rostest.rosrun("kinect_nav", "test_openni2_simulation", OpenNI2Simulation)
