#!/usr/bin/python3
"""A stack as small as can be: a move_base action that drives straight at its goal on the true pose, and says by TF that
its map is the world. Private parameters: abort_goal and die_at_goal (counted from 1), halt (a process
that it stops before it dies), mute_s (for so long after a goal's end the action says nothing, and then first what its status is), commands (false: never publishes on cmd_vel), log (a file that receives a line of JSON for
every goal)."""
import json
import math
import os
import signal
import threading
import time

import actionlib
import rospy
import tf2_ros
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped, Twist
from move_base_msgs.msg import MoveBaseAction
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, LaserScan

WITHIN_M, WITHIN_RAD = 0.03, 0.05


def plane(pose):
    return pose.position.x, pose.position.y, 2 * math.atan2(pose.orientation.z, pose.orientation.w)


def wrapped(angle):
    return math.remainder(angle, 2 * math.pi)


class Server(actionlib.SimpleActionServer):
    """Dies, where it is to, before anybody can hear that it took the goal."""

    goals = die_at_goal = halt = 0

    def internal_goal_callback(self, goal):
        self.goals += 1
        if self.goals == self.die_at_goal:
            if self.halt:
                os.kill(self.halt, signal.SIGSTOP)
            os._exit(1)
        super().internal_goal_callback(goal)


class StandIn:
    def __init__(self):
        self.abort_goal = rospy.get_param("~abort_goal", 0)
        self.log = rospy.get_param("~log", "")
        self.truth = self.odometry = self.said = None
        self.sensors = {}
        self.goals = 0
        self.broadcaster = tf2_ros.TransformBroadcaster()
        self.command = rospy.Publisher("cmd_vel", Twist, queue_size=1) if rospy.get_param("~commands", True) else None
        rospy.Subscriber("odom", Odometry, self.on_odometry, tcp_nodelay=True)
        rospy.Subscriber("ground_truth", Odometry, self.on_truth, tcp_nodelay=True)
        rospy.Subscriber("initialpose", PoseWithCovarianceStamped, self.on_pose)
        for topic, kind in (("scan", LaserScan), ("camera/depth/camera_info", CameraInfo)):
            rospy.Subscriber(topic, kind, self.on_sensor, topic)
        self.server = Server("move_base", MoveBaseAction, self.drive, False)
        self.server.die_at_goal = rospy.get_param("~die_at_goal", 0)
        self.server.halt = rospy.get_param("~halt", 0)
        mute_s = rospy.get_param("~mute_s", 0.0)
        if mute_s > 0.0:
            self.mute_ends_of_goals(mute_s)
        self.server.start()

    def mute_ends_of_goals(self, mute_s):
        actions = self.server.action_server
        publish_status, publish_result = actions.publish_status, actions.publish_result

        def speak_later(*result):
            actions.publish_status = lambda: None
            rospy.sleep(mute_s)
            actions.publish_status = publish_status
            publish_status()
            time.sleep(0.3)
            publish_result(*result)

        actions.publish_result = lambda *result: threading.Thread(target=speak_later, args=result).start()

    def on_sensor(self, message, topic):
        self.sensors[topic] = message.header.frame_id

    def on_pose(self, message):
        self.said = plane(message.pose.pose)

    def on_odometry(self, message):
        self.odometry = plane(message.pose.pose)

    def on_truth(self, message):
        self.truth = plane(message.pose.pose)
        if self.odometry is None:
            return
        x, y, yaw = self.odometry
        turn = wrapped(self.truth[2] - yaw)
        transform = TransformStamped()
        transform.header.stamp, transform.header.frame_id, transform.child_frame_id = message.header.stamp, "map", "odom"
        transform.transform.translation.x = self.truth[0] - (math.cos(turn) * x - math.sin(turn) * y)
        transform.transform.translation.y = self.truth[1] - (math.sin(turn) * x + math.cos(turn) * y)
        transform.transform.rotation.z, transform.transform.rotation.w = math.sin(turn / 2), math.cos(turn / 2)
        self.broadcaster.sendTransform(transform)

    def send(self, v, w):
        twist = Twist()
        twist.linear.x, twist.angular.z = v, w
        self.command.publish(twist)

    def drive(self, goal):
        self.goals += 1
        if self.log:
            with open(self.log, "a", encoding="utf-8") as text:
                text.write(json.dumps({"goal": plane(goal.target_pose.pose), "frame": goal.target_pose.header.frame_id,
                                       "truth": self.truth, "said": self.said, "sensors": self.sensors}) + "\n")
        if self.goals == self.abort_goal:
            self.server.set_aborted(text="the floor is wet")
            return
        x, y, yaw = plane(goal.target_pose.pose)
        rate = rospy.Rate(20)
        while not rospy.is_shutdown() and not self.server.is_preempt_requested():
            left_m = math.hypot(x - self.truth[0], y - self.truth[1])
            if left_m > WITHIN_M:
                off = wrapped(math.atan2(y - self.truth[1], x - self.truth[0]) - self.truth[2])
                self.send(min(0.5, left_m) if abs(off) < 0.3 else 0.0, max(-1.0, min(1.0, 2 * off)))
            else:
                off = wrapped(yaw - self.truth[2])
                if abs(off) < WITHIN_RAD:
                    self.send(0.0, 0.0)
                    self.server.set_succeeded()
                    return
                self.send(0.0, max(-1.0, min(1.0, 2 * off)))
            try:
                rate.sleep()
            except rospy.ROSInterruptException:
                return
        self.send(0.0, 0.0)
        self.server.set_preempted()


if __name__ == "__main__":
    rospy.init_node("stand_in_move_base")
    StandIn()
    rospy.spin()
