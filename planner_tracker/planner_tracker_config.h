#pragma once

#include <string>
#include <vector>

#include "planner_tracker/footprint.h"

namespace knav {

/// What the robot keeps away from, and how the maps are read.
struct ClearanceConfig {
  double hard_m = 0.04;
  double insist = 0.75;
  double keep = 0.5;
  double preferred_m = 0.25;
  double price = 2.0;
  double escape_m = 1.0;
  double half_seen_m = 0.1;
  double half_seen_within_m = 1.3;
  double unseen_depth_m = 0.3;
  int occupied_threshold = 65;
  int free_threshold = 25;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("hard_m", hard_m, 0, 1, "m", "Never nearer than this beyond the robot's radius.");
    v.number("insist", insist, 0, 1, "",
             "Of hard_m, what the tracker insists on, measured to the returns of scan_360: the rest is for the cells' size and the pose's noise.");
    v.number("keep", keep, 0, 1, "",
             "Of hard_m, what a way once taken must leave to count as open: in a lane just as wide as the robot needs, walls move by a cell from "
             "one local map to the next.");
    v.number("preferred_m", preferred_m, 0, 1.5, "m",
             "Nearer than this beyond the radius costs extra and is slow.");
    v.number("price", price, 0, 50, "", "A metre of path that just keeps hard_m costs 1 + price metres.");
    v.number("escape_m", escape_m, 0, 3, "m",
             "A robot that stands nearer to something than hard_m may leave by a way this long that never "
             "comes nearer.");
    v.number("half_seen_m", half_seen_m, 0, 0.5, "m",
             "What came up near the robot and was never in view from farther away than half_seen_within_m counts as so much wider all round: "
             "of somebody who stepped beside it the camera has seen legs only. 0 = off.");
    v.number("half_seen_within_m", half_seen_within_m, 0, 4, "m", "By a camera of the Kinect's view 0.3 m above the floor: beyond, it sees a body.");
    v.number("unseen_depth_m", unseen_depth_m, 0, 2, "m",
             "What is not the map's may be this deep behind what was seen of it: ground so near to it that the local map has not seen is not "
             "driven on. 0 = it is, where the map says free.");
    v.integer("occupied_threshold", occupied_threshold, 1, 100, "%",
              "Cells of a map from here on are occupied.");
    v.integer("free_threshold", free_threshold, 0, 99, "%", "Cells up to this are free; between is unknown.");
  }
};

/// When a new plan replaces the old one, and when the planner gives up.
struct PlanningConfig {
  double switch_gain = 0.08;
  double switch_gain_m = 0.30;
  double hold_s = 4.0;
  double hold_detour_m = 2.0;
  double hold_share = 0.15;
  double controller_patience = 3.0;
  double blocked_timeout_s = 40.0;
  double look_distance_m = 1.8;
  double back_up_after_s = 1.5;
  double closed_memory_s = 120.0;
  double somebody_memory_s = 30.0;
  /// Nearer to a closed place than this, the robot looks at it from elsewhere.
  double too_near_m() const { return 0.75 * look_distance_m; }
  double slowness = 5.0;
  double goal_snap_m = 1.5;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("switch_gain", switch_gain, 0, 1, "",
             "A new plan replaces a passable old one only if it is cheaper by this share ...");
    v.number("switch_gain_m", switch_gain_m, 0, 10, "m", "... and this much.");
    v.number("hold_s", hold_s, 0, 60, "s",
             "A way that has just been closed is kept for this long, as whoever walks there walks on, if the way round is longer ...");
    v.number("hold_detour_m", hold_detour_m, 0, 100, "m", "... by more than this.");
    v.number("hold_share", hold_share, 0, 1, "",
             "Where somebody walked a moment ago it is kept longer, for this share of what the way round takes longer at full speed.");
    v.number("controller_patience", controller_patience, 0.1, 60, "s",
             "The robot waits this long before something in its way, replanning, before it tries reactive "
             "avoidance.");
    v.number("blocked_timeout_s", blocked_timeout_s, 1, 600, "s",
             "Without progress for this long the goal fails.");
    v.number("look_distance_m", look_distance_m, 0.3, 5, "m",
             "A closed way is looked at from this far: nearer, a level Kinect does not see whether it is free again.");
    v.number("back_up_after_s", back_up_after_s, 0, 60, "s",
             "Standing this long before something nearer than that, the robot backs up to that distance, over ground it has "
             "just driven and where nothing is in the scan: it sees more, and whoever wants to pass can; 0 = never.");
    v.number("closed_memory_s", closed_memory_s, 0, 3600, "s",
             "What the local map showed occupied stays so for this long once it is off its edge, so that the robot does not "
             "turn to and fro between a way found closed and another.");
    v.number("somebody_memory_s", somebody_memory_s, 0, 3600, "s",
             "The same where somebody walked a moment before who closes the way: by then he has walked on, and the way back may be the shorter.");
    v.number("slowness", slowness, 1, 100, "",
             "The goal fails after 60 s plus this many times what its first plan takes at full speed.");
    v.number("goal_snap_m", goal_snap_m, 0, 5, "m",
             "While something unexpected stands on the goal, the robot goes to a free point within this "
             "distance.");
  }
};

/// How the path is followed.
struct TrackingConfig {
  double lookahead_m = 0.55;
  double turn_first_rad = 0.60;
  double unseen_turn_first_rad = 0.16;
  double turned_rad = 0.15;
  double slow_mps = 0.25;
  double reaction_s = 0.20;
  double horizon_s = 1.5;
  double min_in_place_vel_theta = 0.15;
  double stop_decel_mps2 = 1.0;
  double moving_mps = 3.0;
  double moving_distance_m = 0.8;
  double walker_gap_m = 0.3;
  double walker_memory_s = 3.0;
  double walker_stands_s = 6.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("lookahead_m", lookahead_m, 0.1, 3, "m",
             "The robot steers at the point of the path this far ahead.");
    v.number("turn_first_rad", turn_first_rad, 0.1, 3.2, "rad",
             "Further off than this, the robot turns in place, so that it sees where it will drive.");
    v.number("unseen_turn_first_rad", unseen_turn_first_rad, 0.1, 3.2, "rad",
             "The same where the arc to there sweeps ground that the local map has not seen: behind a corner something may stand "
             "right beside the way, which a camera that looks along the arc does not show.");
    v.number("turned_rad", turned_rad, 0.02, 1, "rad", "Such a turn ends when this little is left.");
    v.number("slow_mps", slow_mps, 0.02, 1, "m/s", "Speed where only the hard clearance is left.");
    v.number("reaction_s", reaction_s, 0, 1, "s", "From light in the Kinect to brakes on the wheels.");
    v.number("horizon_s", horizon_s, 0.3, 5, "s", "Rollouts look this far ahead.");
    v.number("min_in_place_vel_theta", min_in_place_vel_theta, 0, 1, "rad/s", "Slowest turn in place.");
    v.number("stop_decel_mps2", stop_decel_mps2, 0.1, 10, "m/s^2", "Braking when something is in the way.");
    v.number("moving_mps", moving_mps, 0.02, 3, "m/s", "Speed right beside what moves or has just appeared (max_vel_x or more: no slower for it); max_vel_x ...");
    v.number("moving_distance_m", moving_distance_m, 0.05, 5, "m", "... is allowed this far from it.");
    v.number("walker_gap_m", walker_gap_m, 0, 3, "m",
             "Who was seen walking, and is out of view now, is expected to walk on as he did: the robot stops where he and it would come "
             "nearer to each other than this within 2 s. 0 = off.");
    v.number("walker_memory_s", walker_memory_s, 0, 3, "s", "Expected for so long after he was last seen.");
    v.number("walker_stands_s", walker_stands_s, 0, 60, "s",
             "He may also have stopped right out of view: for so long, unless seen, a place as wide as somebody counts as occupied where he was "
             "lost and half a second farther on. 0 = off.");
  }
};

/// What happens when driving on is not possible.
struct RecoveryConfig {
  double lost_timeout_s = 120.0;
  double lost_turn_radps = 0.8;
  double wander_radius_m = 3.0;
  double wander_step_m = 2.5;
  double wander_mps = 0.3;
  double avoid_min_m = 0.15;
  double avoid_max_m = 0.50;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("lost_timeout_s", lost_timeout_s, 1, 3600, "s", "Lost for this long, the goal fails.");
    v.number("lost_turn_radps", lost_turn_radps, 0.05, 3, "rad/s", "A lost robot looks round at this rate.");
    v.number("wander_radius_m", wander_radius_m, 0, 20, "m",
             "... then wanders, at most this far from there; after each further look round as much farther, ...");
    v.number("wander_step_m", wander_step_m, 0.1, 10, "m", "... in moves of up to this, ...");
    v.number("wander_mps", wander_mps, 0.05, 1, "m/s", "... at this speed.");
    v.number("avoid_min_m", avoid_min_m, 0.05, 2, "m",
             "Shortest of the random translations towards open space.");
    v.number("avoid_max_m", avoid_max_m, 0.05, 5, "m", "Longest of them.");
  }
};

/// Silence stops the robot, and so does data that comes late.
struct FreshnessConfig {
  double scan_s = 0.18;
  double pose_s = 0.18;
  double localization_s = 3.0;
  double latency_s = 0.5;
  double give_up_s = 15.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("scan_s", scan_s, 0.05, 10, "s", "No new scan_360 for this long stops the robot.");
    v.number("pose_s", pose_s, 0.05, 10, "s",
             "So does no new odometry or pose (TF map -> base_link) for this long,");
    v.number("localization_s", localization_s, 0.1, 60, "s",
             "and a localizer silent for this long, once it spoke.");
    v.number("latency_s", latency_s, 0.05, 10, "s",
             "Scans, odometry and poses whose stamps are older than this stop it too.");
    v.number("give_up_s", give_up_s, 0.1, 600, "s", "Stopped by missing data for this long, the goal fails.");
  }
};

/// Planner and tracker. The top level has move_base's and its planners' names where the meaning is the same.
struct PlannerTrackerConfig {
  int seed = 1;
  double controller_frequency = 20.0;
  double planner_frequency = 6.0;
  double xy_goal_tolerance = 0.05;
  double yaw_goal_tolerance = 0.08;
  bool latch_xy_goal_tolerance = true;
  int goal_corrections = 1;
  double max_vel_x = 0.6;
  double min_vel_x = -0.10;
  double max_vel_theta = 1.2;
  double acc_lim_x = 1.0;
  double acc_lim_theta = 2.5;
  double robot_radius = 0.20;
  std::string footprint;
  double oscillation_timeout = 12.0;
  double oscillation_distance = 0.30;
  std::string global_frame = "map";
  std::string robot_base_frame = "base_link";
  std::string odom_frame = "odom";
  std::string places_file;
  ClearanceConfig clearance;
  PlanningConfig planning;
  TrackingConfig tracking;
  RecoveryConfig recovery;
  FreshnessConfig freshness;

  /// The outline; a disc of robot_radius where `footprint` is empty or faulty (see validate()).
  Footprint outline() const;
  /// The centre keeps this far from everything, whichever way the robot faces.
  double hard_radius_m() const { return outline().inscribed_m() + clearance.hard_m; }
  /// ... and this far on a way once taken, see ClearanceConfig::keep.
  double keep_radius_m() const { return outline().inscribed_m() + clearance.keep * clearance.hard_m; }
  /// ... and this far where there is room, so that it can face any way.
  double preferred_radius_m() const { return outline().circumscribed_m() + clearance.preferred_m; }

  template <class Visitor>
  void visit(Visitor& v) {
    v.integer("seed", seed, 0, 2147483647, "", "Of the random recoveries.");
    v.number("controller_frequency", controller_frequency, 1, 100, "Hz", "Rate of cmd_vel.");
    v.number("planner_frequency", planner_frequency, 0.2, 50, "Hz", "Rate of replanning.");
    v.number("xy_goal_tolerance", xy_goal_tolerance, 0.01, 2, "m", "How near the goal is there.");
    v.number("yaw_goal_tolerance", yaw_goal_tolerance, 0.01, 3.2, "rad", "How well aligned with it.");
    v.flag("latch_xy_goal_tolerance", latch_xy_goal_tolerance,
           "Once within xy_goal_tolerance, only turn, whatever the localizer says next ...");
    v.integer("goal_corrections", goal_corrections, 0, 10, "",
              "... until it faces the goal's heading: farther off than xy_goal_tolerance then, it drives up to it anew, so often at most.");
    v.number("max_vel_x", max_vel_x, 0.05, 3, "m/s", "Fastest.");
    v.number("min_vel_x", min_vel_x, -1, 0, "m/s",
             "Fastest backwards, used only over a goal just overshot and where scan_360 shows free space; 0 "
             "= never.");
    v.number("max_vel_theta", max_vel_theta, 0.1, 10, "rad/s", "Fastest turn.");
    v.number("acc_lim_x", acc_lim_x, 0.05, 10, "m/s^2", "Acceleration, and slowing down where nothing hurries (see tracking/stop_decel_mps2).");
    v.number("acc_lim_theta", acc_lim_theta, 0.1, 50, "rad/s^2", "Acceleration of turns.");
    v.number("robot_radius", robot_radius, 0.02, 2, "m", "Footprint, a disc round base_link, where `footprint` is empty.");
    v.text("footprint", footprint,
           "Footprint, a polygon with base_link inside, as \"[[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]\" (m).");
    v.number("oscillation_timeout", oscillation_timeout, 0, 600, "s",
             "Driving for this long without leaving oscillation_distance calls for reactive avoidance; 0 = "
             "never.");
    v.number("oscillation_distance", oscillation_distance, 0.01, 10, "m", "See oscillation_timeout.");
    v.text("global_frame", global_frame, "Frame of the map.");
    v.text("robot_base_frame", robot_base_frame, "Frame of the robot.");
    v.text("odom_frame", odom_frame, "Frame of odometry.");
    v.text("places_file", places_file,
           "places.yaml with named goals for go_to, or its map directory; empty = none.");
    v.group("clearance", clearance, "Distances to obstacles.");
    v.group("planning", planning, "Global planning.");
    v.group("tracking", tracking, "Path following.");
    v.group("recovery", recovery, "Last resorts.");
    v.group("freshness", freshness, "Safety stops.");
  }
  /// One sentence per fault, empty if none.
  std::vector<std::string> validate() const;
};

}  // namespace knav
