#!/usr/bin/python3
"""Maps a simulated building with a simulated Kinect, then drives through it among people; measures all of it."""
import argparse
import datetime
import json
import math
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE))

import yaml  # noqa: E402

import figures  # noqa: E402
import processes  # noqa: E402
import recordings  # noqa: E402
from processes import DemoError, Process, ProgressLine  # noqa: E402

FRAME_RATE_HZ = 30.0
GOAL_TIME_S = 120.0
REACHED_WITHIN_M = 0.30


class Rates:
    """Real time factor and frames through the chain, while it is open."""

    def __init__(self, topic, message_type):
        import rospy
        self._stamps = set()
        self._open = False
        self._lock = threading.Lock()
        self._subscriber = rospy.Subscriber(topic, message_type, self._add, queue_size=100)

    def _add(self, message):
        with self._lock:
            if self._open:
                self._stamps.add(message.header.stamp.to_nsec())

    def start(self):
        import rospy
        with self._lock:
            self._open = True
        self._wall, self._sim = time.monotonic(), rospy.get_time()

    def stop(self):
        import rospy
        with self._lock:
            self._open = False
        self._subscriber.unregister()
        wall, sim = time.monotonic() - self._wall, rospy.get_time() - self._sim
        due = max(1.0, sim * FRAME_RATE_HZ)
        return {"wall_s": round(wall, 1), "real_time_factor": round(sim / wall, 4),
                "frames_per_second": round(len(self._stamps) / wall, 2),
                "dropped_frames_fraction": round(max(0.0, 1.0 - len(self._stamps) / due), 4)}


class Demo:
    def __init__(self, options):
        self.options = options
        self.out = options.out.resolve()
        self.logs = self.out / "logs"
        self.logs.mkdir(parents=True, exist_ok=True)
        self.worlds = ROOT / "config" / "worlds"
        self.world = self.worlds / "demo_building.yaml"
        self.map = self.out / "map"
        self.line = ProgressLine()
        self.env = dict(os.environ, ROS_LOG_DIR=str(self.logs / "ros"), ROS_HOME=str(self.logs / "ros"),
                        ROS_MASTER_URI=f"http://127.0.0.1:{processes.free_port()}", ROS_IP="127.0.0.1",
                        PYTHONUNBUFFERED="1")
        self.env.pop("ROS_HOSTNAME", None)
        os.environ.update(self.env)
        self.children = []

    # ---- processes -------------------------------------------------------------------------------------------

    def start(self, name, *command):
        child = Process(command, self.logs / f"{name}.log", self.env)
        self.children.append(child)
        return child

    def stop_all(self):
        for child in reversed(self.children):
            child.stop()
        self.children = []

    def program(self, name, *arguments):
        processes.run(["rosrun", "kinect_nav", name, *arguments], self.logs / f"{name}.log", self.env,
                      show=sys.stderr.isatty())

    def check(self):
        for child in self.children:
            child.check()

    # ---- steps -----------------------------------------------------------------------------------------------

    def start_master(self):
        """One master and one clock for both drives: rospy can join only one in its life."""
        self.master = Process(["rosmaster", "--core", "-p", self.env["ROS_MASTER_URI"].rsplit(":", 1)[1]],
                              self.logs / "master.log", self.env)
        deadline = time.monotonic() + 20
        import rosgraph
        while not rosgraph.is_master_online():
            self.master.check()
            if time.monotonic() > deadline:
                raise DemoError("no ROS master came up within 20 s; see logs/master.log.")
            time.sleep(0.1)
        import rospy
        rospy.set_param("/use_sim_time", True)
        rospy.init_node("demo", disable_signals=True)

    def calibrate(self):
        """The simulated Kinect is as wrong as a real one, so it is calibrated as a real one: against a wall."""
        self.line.show("calibrating the depth camera against a wall")
        self.calibration = self.out / "calibration.yaml"
        walls = self.out / "calibration.bag"
        self.program("simulate", self.worlds / "flat_wall.yaml", "--script", self.worlds / "flat_wall_tour.yaml",
                     "--record", walls, "--range", "--depth", "standing", "--seed", self.options.seed)
        self.program("calibrate_depth", walls, "--out", self.calibration, "--json", self.out / "calibration.json",
                     "--report", self.out / "calibration.txt")
        walls.unlink()
        self.line.done("calibrated: " + str(self.calibration.relative_to(self.out.parent)))

    def simulation(self, people):
        world = self.worlds / "demo_people.yaml" if people else self.world
        return ["roslaunch", "kinect_nav", "simulation.launch", f"world:={world}", f"calibration:={self.calibration}",
                f"seed:={self.options.seed}"]

    def map_building(self):
        import rospy
        from kinect_nav.msg import MotionEstimate
        from std_msgs.msg import Bool
        bag = self.out / "mapping.bag"
        self.start("simulation_mapping", *self.simulation(people=False))
        state = self.watch_robot()
        rates = Rates("motion_estimate", MotionEstimate)
        self.wait_for(lambda: state["frames"] > 5, 60, "the simulated robot's first estimates (motion_estimate)")
        depth_s = 1e6 if self.options.all_depth else 20.0
        self.start("mapping", "roslaunch", "kinect_nav", "mapping.launch", f"bag:={bag}", f"depth_s:={depth_s}")
        done = threading.Event()
        rospy.Subscriber("tour_done", Bool, lambda message: message.data and done.set())
        time.sleep(2.0)
        rates.start()
        state["path_m"] = 0.0
        tour = self.start("tour", "rosrun", "kinect_nav", "tour_driver_node",
                          f"_script:={self.worlds / 'demo_tour.yaml'}", "__name:=tour_driver")
        start = time.monotonic()
        while not done.wait(0.2):
            self.check()
            self.line.show(f"mapping: {state['path_m']:.1f} m driven")
            if time.monotonic() - start > 400:
                raise DemoError("the mapping tour did not end within 400 s.")
        measured = rates.stop()
        measured["distance_m"] = round(state["path_m"], 2)
        measured["collisions"] = state["collisions"]
        self.children.remove(tour)
        tour.stop()
        self.stop_all()
        self.line.done(f"mapped: {state['path_m']:.1f} m in {measured['wall_s']:.0f} s, real time factor "
                       f"{measured['real_time_factor']:.3f}, {measured['frames_per_second']:.1f} frames a second")
        return measured

    def build_map(self):
        self.line.show("building the map")
        start = time.monotonic()
        arguments = ["build_map", self.out / "mapping.bag", "--out", self.map, "--from", "profile", "--json",
                     self.out / "build_map.json"]
        self.program(*arguments)
        mapping = recordings.Recording(self.out / "mapping.bag")
        truth = self.out / "mapping_truth.tum"
        mapping.truth.write_tum(truth)
        self.program("evaluate_map", self.map, "--world", self.world, "--truth-trajectory", truth, "--json",
                     self.out / "map_evaluation.json", "--picture", self.out / "map_evaluation.png")
        with open(self.out / "map_evaluation.json", encoding="utf-8") as text:
            evaluation = json.load(text)
        self.line.done(f"built the map in {time.monotonic() - start:.0f} s: {evaluation['map_rmse_m']:.3f} m rmse to "
                       f"the true walls, {evaluation['map_completeness']:.1%} complete")
        return mapping, evaluation

    def drive_to_goals(self, goals):
        import rospy
        from kinect_nav.msg import LocalizationStatus
        self.start("simulation_navigation", *self.simulation(people=True))
        state = self.watch_robot()
        self.wait_for(lambda: state["frames"] > 5, 60, "the simulated robot's first estimates (motion_estimate)")
        self.start("navigation", "roslaunch", "kinect_nav", "navigation.launch", f"map:={self.map}",
                   "initial_pose_known:=true")
        rates = Rates("localization_status", LocalizationStatus)
        self.start("recorder", "rosbag", "record", "-O", self.out / "navigation.bag", "/ground_truth", "/odom", "/tf",
                   "/tf_static", "/localization_status", "/motion_estimate", "/cmd_vel", "/navigation_failure",
                   "/amcl_pose")
        self.wait_for(lambda: state["localized"], 60, "the localizer (localization_status)")
        if self.options.gui:
            self.start("rviz", "roslaunch", "kinect_nav", "view.launch")
        results = []
        rates.start()
        state["path_m"] = 0.0
        for number, (name, goal) in enumerate(goals.items(), start=1):
            results.append(self.drive_to(name, goal, state, f"goal {number} of {len(goals)} ({name})"))
        measured = rates.stop()
        measured["distance_m"] = round(state["path_m"], 2)
        measured["collisions"] = state["collisions"]
        if not self.options.gui:
            self.take_screenshot()
        self.stop_all()
        self.line.done(f"drove {state['path_m']:.1f} m in {measured['wall_s']:.0f} s: "
                       f"{sum(r['succeeded'] for r in results)} of {len(results)} goals, "
                       f"{measured['collisions']} collisions, real time factor {measured['real_time_factor']:.3f}, "
                       f"{measured['frames_per_second']:.1f} frames a second")
        return measured, results

    def drive_to(self, name, goal, state, title):
        import actionlib
        import rospy
        from actionlib_msgs.msg import GoalStatus
        from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
        client = actionlib.SimpleActionClient("move_base", MoveBaseAction)
        if not client.wait_for_server(rospy.Duration(30)):
            raise DemoError("no move_base action server; see logs/navigation.log.")
        message = MoveBaseGoal()
        message.target_pose.header.frame_id = "map"
        message.target_pose.header.stamp = rospy.Time.now()
        position, orientation = message.target_pose.pose.position, message.target_pose.pose.orientation
        position.x, position.y = goal[0], goal[1]
        orientation.z, orientation.w = math.sin(goal[2] / 2), math.cos(goal[2] / 2)
        started, start_m = rospy.get_time(), state["path_m"]
        client.send_goal(message)
        done = (GoalStatus.SUCCEEDED, GoalStatus.ABORTED, GoalStatus.REJECTED, GoalStatus.PREEMPTED)
        while client.get_state() not in done and rospy.get_time() - started < GOAL_TIME_S:
            self.check()
            self.line.show(f"{title}: {state['path_m']:.1f} m driven, localization {state['localization']}")
            time.sleep(0.1)
        succeeded = client.get_state() == GoalStatus.SUCCEEDED
        text = client.get_goal_status_text()
        if client.get_state() not in done:
            client.cancel_goal()
            text = f"not reached within {GOAL_TIME_S:.0f} s"
        return {"name": name, "goal": goal, "succeeded": succeeded, "message": text, "stamp_s": rospy.get_time(),
                "time_s": round(rospy.get_time() - started, 1), "distance_m": round(state["path_m"] - start_m, 2)}

    # ---- watching --------------------------------------------------------------------------------------------

    def watch_robot(self):
        """What the progress line and the waits need, kept up to date by subscribers."""
        import rospy
        from kinect_nav.msg import LocalizationStatus, MotionEstimate
        from nav_msgs.msg import Odometry
        from std_msgs.msg import UInt32
        state = {"path_m": 0.0, "collisions": 0, "frames": 0, "localized": False, "localization": "-"}
        last = {}

        def on_truth(message):
            p = message.pose.pose.position
            if "p" in last:
                state["path_m"] += math.hypot(p.x - last["p"].x, p.y - last["p"].y)
            last["p"] = p

        def on_frame(_):
            state["frames"] += 1

        def on_status(message):
            state["localized"] = state["localized"] or message.status == LocalizationStatus.OK
            state["localization"] = ("ok", "uncertain", "lost", "initializing")[message.status]

        for subscriber in getattr(self, "subscribers", []):
            subscriber.unregister()
        self.subscribers = [rospy.Subscriber("ground_truth", Odometry, on_truth),
                            rospy.Subscriber("motion_estimate", MotionEstimate, on_frame),
                            rospy.Subscriber("localization_status", LocalizationStatus, on_status),
                            rospy.Subscriber("collisions", UInt32,
                                             lambda message: state.update(collisions=message.data))]
        return state

    def wait_for(self, condition, limit_s, what):
        deadline = time.monotonic() + limit_s
        while not condition():
            self.check()
            self.line.show(f"waiting for {what}")
            if time.monotonic() > deadline:
                raise DemoError(f"waited {limit_s:.0f} s in vain for {what}; see {self.logs}.")
            time.sleep(0.1)

    def take_screenshot(self):
        self.line.show("taking a picture of rviz")
        processes.run([HERE / "rviz_screenshot", self.out / "rviz.png", ROOT / "launch" / "navigation.rviz"],
                      self.logs / "rviz.log", self.env)

    # ---- the whole -------------------------------------------------------------------------------------------

    def run(self):
        started = time.monotonic()
        with open(self.world, encoding="utf-8") as text:
            places = yaml.safe_load(text)["places"]
        self.start_master()
        self.calibrate()
        mapping_measured = self.map_building()
        mapping, evaluation = self.build_map()
        # The map's origin is the robot's start; a user would click the goals in the map.
        map_world_start = recordings.inverse(mapping.truth.poses[0])
        goals = {name: recordings.compose(map_world_start, (x, y, math.radians(yaw_deg)))
                 for name, (x, y, yaw_deg) in places.items()}
        navigation_measured, results = self.drive_to_goals(goals)
        summary = self.summarize(mapping, evaluation, goals, mapping_measured, navigation_measured, results)
        summary["elapsed_s"] = round(time.monotonic() - started, 1)
        path = self.out / "summary.json"
        part = path.with_suffix(".json.part")
        part.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        part.rename(path)
        keys = ("goals_reached", "goals_total", "collisions", "map_rmse_m", "map_completeness",
                "localization_error_mean_m", "real_time_factor", "frames_per_second", "dropped_frames_fraction")
        for key in keys:
            print(f"  {key:<28} {summary[key]}")
        self.line.done(f"done; pictures and figures are in {self.out}")
        return summary["goals_reached"] == summary["goals_total"] and summary["collisions"] == 0

    def summarize(self, mapping, evaluation, goals, mapping_measured, navigation_measured, results):
        navigation = recordings.Recording(self.out / "navigation.bag")
        world_map = recordings.compose(mapping.truth.poses[0],
                                       (evaluation["alignment_x_m"], evaluation["alignment_y_m"],
                                        math.radians(evaluation["alignment_yaw_deg"])))
        map_world = recordings.inverse(world_map)
        errors, angles = recordings.position_errors(navigation.estimate, navigation.truth, world_map)
        if not errors:
            raise DemoError("the recording of the drive holds no estimate; see logs/navigation.log.")
        for result in results:
            true = recordings.compose(map_world, navigation.truth.at(min(result["stamp_s"], navigation.truth.stamps[-1])))
            result["true_distance_to_goal_m"] = round(
                math.hypot(true[0] - result["goal"][0], true[1] - result["goal"][1]), 3)
        figures.map_picture(self.map, goals, self.out / "map.png")
        figures.trajectory_picture(
            self.map, [("mapping drive", mapping, recordings.read_tum(self.map / "trajectory.tum")),
                       ("navigation", navigation, navigation.estimate)], map_world, goals, self.out / "trajectory.png")
        both = (mapping_measured, navigation_measured)
        return {
            "goals_reached": sum(r["succeeded"] and r["true_distance_to_goal_m"] <= REACHED_WITHIN_M for r in results),
            "goals_total": len(results),
            "collisions": mapping_measured["collisions"] + navigation_measured["collisions"],
            "map_rmse_m": round(evaluation["map_rmse_m"], 4),
            "map_completeness": round(evaluation["map_completeness"], 4),
            "localization_error_mean_m": round(sum(errors) / len(errors), 4),
            "localization_error_max_m": round(max(errors), 4),
            "localization_error_mean_deg": round(math.degrees(sum(angles) / len(angles)), 3),
            "real_time_factor": min(m["real_time_factor"] for m in both),
            "frames_per_second": min(m["frames_per_second"] for m in both),
            "dropped_frames_fraction": max(m["dropped_frames_fraction"] for m in both),
            "mapping": mapping_measured,
            "navigation": navigation_measured,
            "goals": results,
            "goal_reached_within_m": REACHED_WITHIN_M,
            "T_world_map": dict(zip(("x_m", "y_m", "yaw_rad"), world_map)),
            "seed": self.options.seed,
            "date": datetime.date.today().isoformat(),
            "processor": processor(),
            "commit": commit(),
        }


def processor():
    with open("/proc/cpuinfo", encoding="utf-8") as text:
        for line in text:
            if line.startswith("model name"):
                return f"{line.split(':', 1)[1].strip()}, {os.cpu_count()} cores"
    return platform.machine()


def commit():
    try:
        result = subprocess.run(["git", "-C", str(ROOT), "describe", "--always", "--dirty"], capture_output=True, text=True,
                                check=False)
    except FileNotFoundError:  # a machine without git
        return "unknown"
    return result.stdout.strip() or "unknown"


def main():
    parser = argparse.ArgumentParser(prog="scripts/demo", description=__doc__)
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "demo_output", help="folder for the results")
    parser.add_argument("--gui", action="store_true", help="watch in rviz; no screenshot is taken")
    parser.add_argument("--all-depth", action="store_true", help="record all raw depth (18 MB a second), not 20 s")
    parser.add_argument("--seed", type=int, default=1, help="of every random stream")
    options = parser.parse_args()
    demo = Demo(options)
    try:
        return 0 if demo.run() else 1
    except DemoError as error:
        print(f"\ndemo: error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ndemo: interrupted", file=sys.stderr)
        return 130
    finally:
        demo.stop_all()
        if hasattr(demo, "master"):
            demo.master.stop()


if __name__ == "__main__":
    sys.exit(main())
