#!/usr/bin/python3
"""brin_benchmark --config external scores a stand-in for a stack: what it reaches, gives up, and dies of."""
import json
import math
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import rosgraph
import rospy
import rostest

HERE = pathlib.Path(__file__).resolve().parent
LIMIT_S = 120
NAME = "/stand_in_move_base"


def program():
    found = subprocess.run(["catkin_find", "--libexec", "kinect_nav", "brin_benchmark"], capture_output=True, text=True,
                           check=True).stdout.split()
    return found[0]


class StandIn:
    """The stand-in as a process."""

    def __init__(self, **parameters):
        arguments = [f"_{key}:={value}" for key, value in parameters.items()]
        # Parameters of the one before would stay on the master.
        if rospy.has_param(NAME):
            rospy.delete_param(NAME)
        self.address_before = self.address()
        self.process = subprocess.Popen([sys.executable, str(HERE / "stand_in_move_base.py"), *arguments])

    def __enter__(self):
        return self

    @staticmethod
    def address():
        """Of the node that serves the action now or did last; None if none ever did."""
        master = rosgraph.Master(rospy.get_name())
        served = dict(master.getSystemState()[1]).get("/move_base/goal", [])
        return master.lookupNode(NAME) if NAME in served else None

    def await_server(self):
        deadline_s = time.monotonic() + LIMIT_S
        while self.address() in (None, self.address_before):
            if time.monotonic() > deadline_s:
                raise AssertionError("the stand-in does not serve move_base")
            time.sleep(0.05)

    def __exit__(self, *_):
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            # A rospy node that is told to end while it is still registering itself may never hear of it.
            self.process.kill()
            self.process.wait()


class ExternalBenchmark(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        result = cls.finish(cls.start(cls.folder / "map", "--map-only"))
        assert result[0] == 0 and "map.yaml" in result[1], result

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def setUp(self):
        self.out = self.folder / self._testMethodName
        shutil.copytree(self.folder / "map", self.out)

    @staticmethod
    def start(out, *arguments, **environment):
        room = HERE / "room"
        return subprocess.Popen([program(), "--config", "external", "--world", str(room / "room.yaml"), "--changes",
                                 str(room / "changes.yaml"), "--out", str(out), *arguments], stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, text=True, env=dict(os.environ, **environment))

    @staticmethod
    def finish(process):
        try:
            text = process.communicate(timeout=LIMIT_S)[0]
        finally:
            process.kill()
        return process.returncode, text

    def run_benchmark(self, *arguments, **environment):
        return self.finish(self.start(self.out, "--rate", "0", *arguments, **environment))

    def assert_refused(self, result, *words):
        self.assertEqual(result[0], 1, result[1])
        for word in words:
            self.assertIn(word, result[1])
        self.assertNotIn("terminate called", result[1])
        self.assert_nothing_written()

    def assert_nothing_written(self):
        self.assertEqual(sorted(os.listdir(self.out)), ["map", "setup.json", "waypoints.json"])

    def legs(self):
        return json.loads((self.out / "run_01.json").read_text())["legs"]

    def test_a_missing_master_is_said(self):
        self.assert_refused(self.run_benchmark(ROS_MASTER_URI="http://127.0.0.1:9"), "no ROS master", "127.0.0.1:9")

    def test_a_clock_of_its_own_is_said(self):
        rospy.set_param("/use_sim_time", False)
        try:
            self.assert_refused(self.run_benchmark(), "/use_sim_time")
        finally:
            rospy.set_param("/use_sim_time", True)

    def test_a_missing_server_is_said(self):
        self.assert_refused(self.run_benchmark("--ready-within", "2"), "/move_base", "within 2 s")

    def test_missing_velocity_commands_are_said(self):
        with StandIn(commands=False):
            self.assert_refused(self.run_benchmark("--ready-within", "10"), "/cmd_vel")

    def test_goals_without_a_waypoint_are_said(self):
        goals = self.folder / "places.yaml"
        goals.write_text("start: {x_m: 0, y_m: 0}\nfar: {x_m: 2.8, y_m: 0}\n")
        with StandIn():
            self.assert_refused(self.run_benchmark("--goals", str(goals)), "places.yaml", "'near'")

    def test_goals_may_be_those_of_another_map(self):
        goals, log = self.folder / "own_map.yaml", self.folder / "own_map.log"
        goals.write_text("start: {x_m: 0.1, y_m: 0, yaw_rad: 0}\nfar: {x_m: 2.5, y_m: 0.2}\nnear: {x_m: 1.1, y_m: 0}\n")
        with StandIn(log=log):
            code, text = self.run_benchmark("--goals", str(goals))
        self.assertEqual(code, 0, text)
        first = json.loads(log.read_text().splitlines()[0])
        self.assert_near(first["goal"], (2.5, 0.2), 1e-3)
        self.assert_near(first["said"], (0.1, 0.0), 1e-3)

    def test_legs_are_scored_and_the_robot_is_set_down_where_it_failed(self):
        log = self.folder / "goals.log"
        with StandIn(abort_goal=2, log=log):
            code, text = self.run_benchmark("--lidar")
        self.assertEqual(code, 0, text)
        legs = self.legs()
        self.assertEqual([leg["reached"] for leg in legs], [True, False, True])
        self.assertEqual(legs[1]["reason"], "the floor is wet")
        self.assertIn("the floor is wet", (self.out / "report.md").read_text())
        for leg in (legs[0], legs[2]):
            # The stand-in stops within 0.03 m of where the map has the waypoint; the map of a room is good to 0.05 m.
            self.assertLess(leg["positioning_error_m"], 0.10)
        self.assertLess(legs[0]["time_s"], 30.0)
        near = {w["name"]: w for w in json.loads((self.out / "waypoints.json").read_text())}["near"]
        goals = [json.loads(line) for line in log.read_text().splitlines()]
        self.assertEqual([goal["frame"] for goal in goals], ["map"] * 3)
        self.assert_near(goals[1]["goal"], near["map_x_y_yaw_m_rad"], 1e-3)
        self.assert_near(goals[0]["said"], (0, 0, 0), 1e-3)
        self.assert_near(goals[2]["said"], near["map_x_y_yaw_m_rad"], 1e-3)
        self.assert_near(goals[2]["truth"], near["world_x_y_yaw_m_rad"], 1e-2)
        self.assertEqual(goals[2]["sensors"], {"scan": "laser", "camera/depth/camera_info": "camera_depth_optical_frame"})
        for name in ("run_01.png", "run_01_truth.tum", "run_01_estimate.tum", "report.json"):
            self.assertTrue((self.out / name).exists(), name)

    def assert_near(self, pose, expected, within):
        self.assertLess(math.hypot(pose[0] - expected[0], pose[1] - expected[1]), within, (pose, expected))

    def test_a_server_that_dies_for_good_ends_the_benchmark_with_a_sentence(self):
        with StandIn(die_at_goal=1):
            self.assert_refused(self.run_benchmark("--ready-within", "4"), "/move_base", "went away")

    def test_a_server_that_comes_back_fails_one_leg(self):
        benchmark = self.start(self.out, "--rate", "0")
        self.addCleanup(benchmark.kill)
        # It takes the goal to its grave, and the next one stands there before the benchmark can look again.
        with StandIn(die_at_goal=2, halt=benchmark.pid) as first:
            first.process.wait(LIMIT_S)
            with StandIn() as second:
                second.await_server()
                benchmark.send_signal(signal.SIGCONT)
                code, text = self.finish(benchmark)
        self.assertEqual(code, 0, text)
        legs = self.legs()
        self.assertEqual([leg["reached"] for leg in legs], [True, False, True], text)
        self.assertIn("went away", legs[1]["reason"])

    def test_a_result_that_comes_after_its_goal_has_left_the_status_list_is_heard(self):
        # A server lists what has ended for 5 s by the clock, which a busy machine lets pass unheard when the clock is fast.
        with StandIn(abort_goal=2, mute_s=6.0):
            code, text = self.run_benchmark()
        self.assertEqual(code, 0, text)
        legs = self.legs()
        self.assertEqual([leg["reached"] for leg in legs], [True, False, True], text)
        self.assertEqual(legs[1]["reason"], "the floor is wet")

    def test_an_interrupt_leaves_nothing_half_written(self):
        log = self.folder / "interrupted.log"
        with StandIn(log=log):
            benchmark = self.start(self.out, "--rate", "0.5")
            deadline_s = time.monotonic() + LIMIT_S
            while not log.exists() and time.monotonic() < deadline_s:
                time.sleep(0.05)
            benchmark.send_signal(signal.SIGINT)
            code, text = self.finish(benchmark)
        self.assertEqual(code, 130, text)
        self.assert_nothing_written()


if __name__ == "__main__":
    rostest.rosrun("kinect_nav", "external_benchmark", ExternalBenchmark, sys.argv)
