#!/usr/bin/python3
"""Bad input to the programs: one clear sentence that names the file, exit code 1, nothing half-written. Good input:
the same bytes twice."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import rosbag
import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

PROGRAMS = pathlib.Path(sys.argv[1])
PROGRAM_NAMES = ("replay", "build_map", "import_carmen", "import_depth_images", "evaluate_trajectory", "calibrate_depth",
                 "calibrate_depth_live", "calibrate_extrinsics", "calibrate_intrinsics", "check_robot", "score_walls",
                 "optimize_graph", "map_info", "localize")
# Only with the simulator (-DKINECT_NAV_SIM=ON).
PROGRAM_NAMES += tuple(n for n in ("sensor_benchmark", "compare_sensor_model") if (PROGRAMS / n).exists())


def run(name, *arguments):
    result = subprocess.run([str(PROGRAMS / name), *map(str, arguments)], capture_output=True, text=True, timeout=120,
                            check=False)
    return result.returncode, result.stdout + result.stderr


def write_bag(path, scans=True, odometry=True, seconds=4):
    """A robot that stands before a wall 2 m ahead."""
    with rosbag.Bag(str(path), "w") as bag:
        for i in range(seconds * 10):
            stamp = rospy.Time.from_sec(100.0 + i * 0.1)
            if odometry:
                message = Odometry()
                message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, "odom", "base_link"
                message.pose.pose.orientation.w = 1.0
                bag.write("/odom", message, stamp)
            if scans:
                scan = LaserScan()
                scan.header.stamp, scan.header.frame_id = stamp, "base_link"
                scan.angle_min, scan.angle_max, scan.angle_increment = -0.5, 0.5, 0.01
                scan.range_min, scan.range_max = 0.1, 20.0
                scan.ranges = [2.0] * 101
                bag.write("/scan", scan, stamp)


class Programs(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.dir = pathlib.Path(self._folder.name)

    def tearDown(self):
        self._folder.cleanup()

    def assert_refused(self, result, *words):
        code, text = result
        self.assertEqual(code, 1, text)
        for word in words:
            self.assertIn(str(word), text)
        self.assertNotIn("terminate called", text)

    def assert_only(self, *names):
        self.assertEqual(sorted(os.listdir(self.dir)), sorted(names))

    def test_every_program_has_help(self):
        for name in PROGRAM_NAMES:
            code, text = run(name, "--help")
            self.assertEqual(code, 0, name)
            self.assertIn("Options", text, name)

    def test_wrong_command_line_is_exit_code_1(self):
        for name in PROGRAM_NAMES:
            code, text = run(name, "--no-such-option")
            self.assertEqual(code, 1, name + text)
            self.assertIn("--help", text, name)

    def test_the_guided_calibration_says_that_no_robot_runs(self):
        os.environ["ROS_MASTER_URI"] = "http://127.0.0.1:9"  # nobody listens there
        self.assert_refused(run("calibrate_depth_live", self.dir / "walls", "--out", self.dir / "out.yaml"), "master")
        self.assert_only()

    def test_missing_empty_and_malformed_bags_are_refused(self):
        empty = self.dir / "empty.bag"
        empty.touch()
        garbage = self.dir / "garbage.bag"
        garbage.write_bytes(b"this is not a bag" * 1000)
        out = self.dir / "out"
        for bag in (self.dir / "absent.bag", empty, garbage):
            self.assert_refused(run("replay", bag, "--trajectory", out), bag)
            self.assert_refused(run("build_map", bag, "--out", out), bag)
        self.assert_only("empty.bag", "garbage.bag")

    def test_truncated_bag_is_refused_with_what_to_do(self):
        whole = self.dir / "whole.bag"
        write_bag(whole)
        cut = self.dir / "cut.bag"
        cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
        for result in (run("replay", cut, "--trajectory", self.dir / "out.tum"),
                       run("build_map", cut, "--out", self.dir / "map")):
            self.assert_refused(result, cut, "rosbag reindex")
        self.assert_only("whole.bag", "cut.bag")

    def test_missing_topics_are_named(self):
        bag = self.dir / "drive.bag"
        write_bag(bag, odometry=False)
        self.assert_refused(run("replay", bag, "--trajectory", self.dir / "out.tum"), bag, "odom")
        self.assert_refused(run("build_map", bag, "--out", self.dir / "map"), bag, "odom")
        for program in ("calibrate_extrinsics", "check_robot"):  # neither depth nor odometry
            code, text = run(program, bag)
            self.assertEqual(code, 1, text)
        self.assert_refused(run("calibrate_extrinsics", bag), bag, "camera/depth/image_raw")
        write_bag(bag, scans=False)
        self.assert_refused(run("replay", bag, "--trajectory", self.dir / "out.tum"), bag, "depth_profile")
        self.assert_only("drive.bag")

    def test_unknown_configuration_key_is_refused_with_suggestion(self):
        bag, config = self.dir / "drive.bag", self.dir / "config.yaml"
        write_bag(bag)
        config.write_text("local_mapper:\n  filter:\n    partciles: 5\n")
        self.assert_refused(run("replay", bag, "--trajectory", self.dir / "out.tum", "--config", config), config,
                            "partciles", "did you mean 'filter/particles'")
        config.write_text("local_mapper: {filter: {particles: -5}}\n")
        self.assert_refused(run("replay", bag, "--trajectory", self.dir / "out.tum", "--config", config), "particles")
        config.write_text("local_maper: {filter: {particles: 5}}\n")
        for program, output in (("replay", ("--trajectory", self.dir / "out.tum")), ("build_map", ("--out", self.dir / "map"))):
            self.assert_refused(run(program, bag, *output, "--config", config), config, "local_maper",
                                "did you mean 'local_mapper'")
        config.write_text("local_mapper: [\n")
        self.assert_refused(run("replay", bag, "--trajectory", self.dir / "out.tum", "--config", config), config, "line")
        self.assert_only("drive.bag", "config.yaml")

    def test_replay_gives_the_same_bytes_twice(self):
        bag = self.dir / "drive.bag"
        write_bag(bag)
        for name in ("a.tum", "b.tum"):
            code, text = run("replay", bag, "--trajectory", self.dir / name, "--seed", 3)
            self.assertEqual(code, 0, text)
        first = (self.dir / "a.tum").read_bytes()
        self.assertEqual(first, (self.dir / "b.tum").read_bytes())
        self.assertGreater(len(first.splitlines()), 30)

    def test_unwritable_output_is_named_and_leaves_nothing(self):
        bag = self.dir / "drive.bag"
        write_bag(bag)
        self.assert_refused(run("replay", bag, "--trajectory", self.dir / "absent" / "out.tum"), "absent/out.tum")
        self.assert_only("drive.bag")

    def test_evaluation_without_common_stamps_says_so(self):
        (self.dir / "a.tum").write_text("1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n")
        (self.dir / "b.tum").write_text("100 0 0 0\n101 1 0 0\n")
        self.assert_refused(run("evaluate_trajectory", self.dir / "a.tum", "--reference", self.dir / "b.tum"),
                            "shares no stamps")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
