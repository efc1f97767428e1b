#!/usr/bin/python3
"""Every shipped launch file loads; every nodelet it names is declared, every node it names exists, and every private
parameter it sets belongs to a section of the default configuration."""
import pathlib
import subprocess
import sys
import unittest
import xml.etree.ElementTree as ET

import roslaunch.config
import roslaunch.xmlloader
import rospkg
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
ARGUMENTS = {"brin_external.launch": ["out:=/tmp/brin"], "calibrate_depth.launch": ["session:=/tmp/walls", "out:=/tmp/kinect.yaml"],
             "live_mapping.launch": ["directory:=/tmp/map"], "mapping.launch": ["bag:=/tmp/drive.bag"], "navigation.launch": ["map:=/tmp/map"],
             "replay.launch": ["bag:=/tmp/drive.bag"]}
LAUNCH_FILES = sorted(path.name for path in (ROOT / "launch").glob("*.launch"))
# Only with -DKINECT_NAV_SIM=ON.
WITH_SIMULATOR = bool(subprocess.run(["catkin_find", "--libexec", "kinect_nav", "simulate"], capture_output=True, text=True,
                                     check=False).stdout.strip())


def declared_nodelets():
    names = set()
    for plugins in ROOT.glob("*/nodelet_plugins.xml"):
        names |= {cls.attrib["name"] for cls in ET.parse(plugins).getroot().iter("class")}
    return names


def load(name):
    config = roslaunch.config.ROSLaunchConfig()
    loader = roslaunch.xmlloader.XmlLoader(resolve_anon=True)
    loader.load(str(ROOT / "launch" / name), config, argv=[name] + ARGUMENTS.get(name, []), verbose=False)
    return config


class LaunchFiles(unittest.TestCase):
    def test_there_are_launch_files(self):
        for name in ("robot.launch", "simulation.launch", "mapping.launch", "navigation.launch", "replay.launch",
                     "view.launch"):
            self.assertIn(name, LAUNCH_FILES)

    def test_every_launch_file_loads_and_names_what_exists(self):
        nodelets = declared_nodelets()
        for name in LAUNCH_FILES:
            with self.subTest(launch=name):
                config = load(name)
                self.assertEqual(config.config_errors, [])
                self.assertTrue(config.nodes)
                for node in config.nodes:
                    rospkg.RosPack().get_path(node.package)
                    if node.type == "nodelet" and node.args.startswith("load"):
                        self.assertIn(node.args.split()[1], nodelets)
                    if node.package == "kinect_nav" and not (node.type == "brin_benchmark" and not WITH_SIMULATOR):
                        found = subprocess.run(["catkin_find", "--libexec", "kinect_nav", node.type],
                                               capture_output=True, text=True, check=False).stdout
                        self.assertTrue(found.strip(), f"{node.type} was not built")

    def test_parameters_set_belong_to_the_node(self):
        with open(ROOT / "config" / "default.yaml", encoding="utf-8") as text:
            default = yaml.safe_load(text)
        for name in LAUNCH_FILES:
            for parameter in load(name).params:
                section, _, key = parameter.strip("/").partition("/")
                if section in default and key:
                    with self.subTest(launch=name, parameter=parameter):
                        group = default[section]
                        for part in key.split("/"):
                            self.assertIn(part, group)
                            group = group[part]

    def test_replay_starts_from_scans_too(self):
        config = roslaunch.config.ROSLaunchConfig()
        roslaunch.xmlloader.XmlLoader().load(str(ROOT / "launch" / "replay.launch"), config,
                                             argv=["replay.launch", "bag:=/tmp/x.bag", "from:=scan"], verbose=False)
        self.assertNotIn("floor_removal", [node.name for node in config.nodes])
        self.assertIn("local_mapper", [node.name for node in config.nodes])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
