#!/usr/bin/python3
"""The whole graph, from simulated light to cmd_vel, takes the robot to a goal in a map_server map and refuses one in
a wall with a reason."""
import math
import sys
import time
import unittest

import actionlib
import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from kinect_nav.msg import LocalizationStatus, NavigationFailure
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_msgs.msg import UInt32


def goal_at(x, y, yaw):
    goal = MoveBaseGoal()
    goal.target_pose.header.frame_id = "map"
    goal.target_pose.header.stamp = rospy.Time.now()
    goal.target_pose.pose.position.x, goal.target_pose.pose.position.y = x, y
    goal.target_pose.pose.orientation.z, goal.target_pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return goal


class DriveToGoal(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        # ROS time reads 0 until the first /clock comes, then leaps: waits begun before would end at the leap.
        rospy.wait_for_message("/clock", Clock, 40)
        while rospy.Time.now().is_zero():
            time.sleep(0.01)
        cls.collisions = 0
        cls.failures = []
        rospy.Subscriber("collisions", UInt32, lambda m: setattr(cls, "collisions", m.data))
        rospy.Subscriber("navigation_failure", NavigationFailure, cls.failures.append)
        cls.client = actionlib.SimpleActionClient("move_base", MoveBaseAction)
        assert cls.client.wait_for_server(rospy.Duration(40)), "no move_base action server"
        deadline_s = time.monotonic() + 40
        while time.monotonic() < deadline_s:
            if rospy.wait_for_message("localization_status", LocalizationStatus, 40).status == LocalizationStatus.OK:
                return
        raise AssertionError("the localizer did not become ok")

    def test_1_scan_follows_rep_117(self):
        scan = rospy.wait_for_message("scan_360", LaserScan, 20)
        self.assertEqual(len(scan.ranges), 3600)
        self.assertEqual(scan.header.frame_id, "base_link")
        for value in scan.ranges:
            self.assertTrue(math.isnan(value) or value == math.inf or scan.range_min <= value <= scan.range_max)
        seen = [value for value in scan.ranges if math.isfinite(value)]
        self.assertGreater(len(seen), 300)
        self.assertEqual(len(scan.intensities), 3600)

    def test_2_goal_is_reached_without_contact(self):
        self.client.send_goal(goal_at(2.8, 0.6, math.pi / 2))
        self.assertTrue(self.client.wait_for_result(rospy.Duration(60)), "not reached within 60 s")
        self.assertEqual(self.client.get_state(), GoalStatus.SUCCEEDED, self.client.get_goal_status_text())
        truth = rospy.wait_for_message("ground_truth", Odometry, 10).pose.pose.position
        # Goal tolerance 0.05 m, and 0.10 m of localization error that the whole stack is allowed.
        self.assertLess(math.hypot(truth.x - 2.8, truth.y - 0.6), 0.15)
        self.assertEqual(self.collisions, 0)

    def test_3_goal_in_a_wall_is_refused_with_a_reason(self):
        self.client.send_goal(goal_at(1.6, -1.4, 0.0))
        self.assertTrue(self.client.wait_for_result(rospy.Duration(30)))
        self.assertEqual(self.client.get_state(), GoalStatus.ABORTED)
        self.assertTrue(self.client.get_goal_status_text())
        rospy.sleep(0.5)
        self.assertEqual(self.failures[-1].code, NavigationFailure.GOAL_OCCUPIED)


if __name__ == "__main__":
    rospy.init_node("test_drive_to_goal")
    rostest.rosrun("kinect_nav", "drive_to_goal", DriveToGoal, sys.argv)
