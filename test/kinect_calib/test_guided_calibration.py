#!/usr/bin/python3
"""calibrate_depth_live takes the simulated robot through five distances, survives Ctrl-C after two, and its calibration
is that of calibrate_depth and is taken by the nodelet."""
import csv
import math
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import rospy
import rostest
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image

PATIENCE_S = 90


def program(name):
    found = subprocess.run(["catkin_find", "--first-only", "--libexec", "kinect_nav", name], capture_output=True, text=True,
                           check=True)
    return found.stdout.strip()


def wait_until(condition):
    deadline_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline_s:
        if condition():
            return True
        time.sleep(0.02)
    return False


class GuidedCalibration(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.session = pathlib.Path(self.folder.name) / "walls"
        self.out = pathlib.Path(self.folder.name) / "kinect.yaml"
        self.commands = []
        self.processes = []
        rospy.Subscriber("cmd_vel", Twist, self.commands.append)

    def tearDown(self):
        for process in self.processes:
            if process.poll() is None:
                process.kill()
                process.wait()
        self.folder.cleanup()

    def start(self, *arguments):
        process = subprocess.Popen(list(arguments), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True)
        self.processes.append(process)
        return process

    def live(self, *more):
        return self.start(program("calibrate_depth_live"), str(self.session), "--out", str(self.out), *more)

    def finish(self, process):
        text, _ = process.communicate(timeout=PATIENCE_S)
        print(text)
        return text

    def distances(self):
        """In the order of the file, each once, with its number of frames."""
        found = {}
        path = self.session / "distances.csv"
        if path.exists():
            for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines()):
                self.assertTrue((self.session / row["file"]).exists())
                found[float(row["distance_m"])] = found.get(float(row["distance_m"]), 0) + 1
        return found

    def test_five_distances_with_an_interruption(self):
        # Messages, not rospy's time: it leaps when the first /clock comes.
        rospy.wait_for_message("ground_truth", Odometry, PATIENCE_S)
        pose = PoseStamped()
        pose.pose.position.x = 4.30
        pose.pose.orientation.z, pose.pose.orientation.w = math.sin(math.radians(3.5)), math.cos(math.radians(3.5))
        publisher = rospy.Publisher("set_pose", PoseStamped, queue_size=1, latch=True)
        self.assertTrue(wait_until(lambda: publisher.get_num_connections() > 0))
        publisher.publish(pose)

        # The robot backs off blind: nobody has said that it may.
        refused = self.live()
        self.assertIn("--yes-behind-is-free", self.finish(refused))
        self.assertEqual(refused.returncode, 1)
        self.assertEqual(self.commands, [])

        broken = self.live("--yes-behind-is-free")
        view = rospy.wait_for_message("calibration_view", Image, PATIENCE_S)
        self.assertEqual((view.width, view.encoding), (640, "bgr8"))
        self.assertTrue(wait_until(lambda: len(self.distances()) >= 2 and self.commands[-1].linear.x < 0))
        broken.send_signal(signal.SIGINT)
        self.assertIn("--resume", self.finish(broken))
        self.assertEqual(broken.returncode, 130)
        self.assertFalse(self.out.exists())
        self.assertTrue(wait_until(lambda: self.commands[-1].linear.x == 0 and self.commands[-1].angular.z == 0))
        kept = list(self.distances())
        self.assertGreaterEqual(len(kept), 2)

        again = self.live("--yes-behind-is-free")
        self.assertIn("--resume", self.finish(again))
        self.assertEqual(again.returncode, 1)

        resumed = self.live("--yes-behind-is-free", "--resume")
        self.finish(resumed)
        self.assertEqual(resumed.returncode, 0)
        distances = self.distances()
        self.assertEqual(list(distances)[:len(kept)], kept)
        self.assertEqual(set(distances.values()), {3})
        self.assertGreaterEqual(len(distances), 5)
        self.assertAlmostEqual(list(distances)[0], 0.6, delta=0.03)
        self.assertAlmostEqual(list(distances)[-1], 0.95, delta=0.05)
        steps = [b / a for a, b in zip(list(distances), list(distances)[1:])]
        self.assertGreaterEqual(min(steps), 1.05)
        self.assertLessEqual(max(steps), 1.15)
        self.assertLessEqual(max(abs(command.linear.x) for command in self.commands), 0.1)
        truth = rospy.wait_for_message("ground_truth", Odometry, PATIENCE_S).pose.pose
        # The wall stands at x = 5 m, the camera 0.05 m ahead of the base.
        self.assertAlmostEqual(5.0 - 0.05 - truth.position.x, list(distances)[-1], delta=0.01)
        self.assertLess(abs(2 * math.degrees(math.asin(truth.orientation.z))), 1.0)

        # The same folder through the offline program: the same file.
        offline = pathlib.Path(self.folder.name) / "offline.yaml"
        fit = self.start(program("calibrate_depth"), str(self.session), "--out", str(offline))
        self.finish(fit)
        self.assertEqual(fit.returncode, 0)
        self.assertEqual(offline.read_text(encoding="utf-8"), self.out.read_text(encoding="utf-8"))

        self.start(program("depth_correction_node"), f"_calibration_file:={self.out}")
        self.assertEqual(rospy.wait_for_message("camera/depth/image_rect", Image, PATIENCE_S).width, 640)


if __name__ == "__main__":
    rospy.init_node("test_guided_calibration")
    rostest.rosrun("kinect_nav", "guided_calibration", GuidedCalibration, sys.argv)
