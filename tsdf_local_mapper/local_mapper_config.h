#pragma once

#include <string>
#include <vector>

#include "core/contour.h"
#include "core/motion_model.h"
#include "core/tsdf_grid.h"
#include "tsdf_local_mapper/close_obstacles.h"
#include "tsdf_local_mapper/odometry_bound.h"
#include "tsdf_local_mapper/odometry_timing.h"
#include "tsdf_local_mapper/range_errors.h"
#include "tsdf_local_mapper/steady_errors.h"
#include "tsdf_local_mapper/window_config.h"

namespace knav {

/// The particle filter over the robot's pose (paper section III.E).
struct FilterConfig {
  int particles = 2000;
  int threads = 1;
  int readings = 200;
  std::string alignment_cost = "normalized";
  double temperature = 0.0003;
  double misfit_cost = 0.03;
  double paper_temperature = 0.02;
  double unknown_price = 0.6;
  int refinements = 0;
  double depth_trust_m = 5.0;
  int thin_rows = 16;
  double evidence_period_s = 0.2;
  double moving_range_m = 2.5;

  template <class Visitor>
  void visit(Visitor& v) {
    v.integer("particles", particles, 10, 200000, "", "Pose hypotheses.");
    v.integer("threads", threads, 1, 64, "",
              "They are moved and compared with the map by so many threads; the same bytes with any number. While mapping see map_builder/drive/mapper_threads.");
    v.integer("readings", readings, 8, 4000, "",
              "Readings of a frame that are compared with the map, at most.");
    v.choice("alignment_cost", alignment_cost, {"paper", "normalized"},
             "paper: sum of |F W| (equation 7). normalized: mean of |F|, with a price for unknown cells.");
    v.number("temperature", temperature, 1e-5, 1, "",
             "normalized: a cost difference this large means a factor e, for a frame that fits without a rest and all "
             "of whose readings have a full say.");
    v.number("misfit_cost", misfit_cost, 0, 1, "",
             "normalized: when even the best hypothesis costs this much, the temperature is twice as high; at more, more: a "
             "frame that fits the map badly (clutter seen from another height, people) is trusted less. 0 = never.");
    v.number("paper_temperature", paper_temperature, 1e-5, 10, "",
             "paper: the same, times the mean weight W.");
    v.number("unknown_price", unknown_price, 0, 1, "", "normalized: cost of a reading in a cell never seen.");
    v.integer("refinements", refinements, 0, 10, "",
              "Rounds of resampling with shrinking noise within a frame.");
    v.number("depth_trust_m", depth_trust_m, 0, 100, "m",
             "DepthProfile: at this range a reading of a surface seen square counts half, beyond less with the range "
             "squared, as a depth camera's steady errors along the ray grow; at a sharp angle they do not matter. 0 = all "
             "count the same.");
    v.integer("thin_rows", thin_rows, 0, 255, "rows",
              "DepthProfile: a surface that fewer rows of the image show (a table's edge, a chair's seat) has no say: from a little farther off "
              "it was not seen at all, but what is behind it. 0 = all have, and so in build_map always.");
    v.number("evidence_period_s", evidence_period_s, 0, 10, "s",
             "Frames closer together than this share errors, and so count by the share of it that has "
             "passed; 0 = every frame "
             "in full.");
    v.number("moving_range_m", moving_range_m, 0, 20, "m",
             "A reading as near as this where nothing was until now is somebody who moves, and says nothing about the pose: "
             "who walks past a robot that turns would turn the estimate with him. Nearer only, if odometry may have turned "
             "the reading there. 0 = off.");
  }
};

/// When the mapper stops trusting that the map and the view belong together.
struct ContinuityConfig {
  double odometry_gap_s = 1.0;
  double odometry_extrapolation_s = 0.1;
  double odometry_max_speed_mps = 5.0;
  double clock_jump_s = 1.0;
  double carried_after_s = 1.0;
  double carried_see_through_fraction = 0.5;
  double carried_agree_fraction = 0.25;
  double carried_view_fraction = 0.6;
  double carried_near_m = 2.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("odometry_gap_s", odometry_gap_s, 0.05, 60, "s",
             "Odometry silent for longer starts a new epoch.");
    v.number("odometry_extrapolation_s", odometry_extrapolation_s, 0, 1, "s",
             "A frame may be this much newer than the newest odometry.");
    v.number("odometry_max_speed_mps", odometry_max_speed_mps, 0.1, 100, "m/s",
             "Odometry that jumps faster than this was reset: a new epoch.");
    v.number("clock_jump_s", clock_jump_s, 0, 60, "s",
             "A frame older than the newest by more: the clock jumped.");
    v.number("carried_after_s", carried_after_s, 0.1, 60, "s",
             "A view that cannot be that of the map for this long means that the robot was carried: a new epoch.");
    v.number("carried_see_through_fraction", carried_see_through_fraction, 0.05, 1, "",
             "It cannot be if this share of the readings on known rays lies behind the map's surface, ...");
    v.number("carried_view_fraction", carried_view_fraction, 0.05, 1, "",
             "... or if on this share of the whole view the readings lie behind that surface, or before it and beyond carried_near_m, ...");
    v.number("carried_near_m", carried_near_m, 0, 20, "m", "... as one or two people who fill the view would be nearer; ...");
    v.number("carried_agree_fraction", carried_agree_fraction, 0, 1, "",
             "... unless this share of the readings on known rays meets the map: people come and go, but what is beside them stays.");
  }
};

/// What only the nodelet uses.
struct LocalMapperRosConfig {
  std::string base_frame = "base_link";
  std::string odom_frame = "odom";
  std::string local_map_frame = "local_map";
  bool publish_tf = true;
  double local_map_rate_hz = 5.0;
  double particlecloud_rate_hz = 2.0;
  int frames_waiting = 5;
  std::string range_errors_file;

  template <class Visitor>
  void visit(Visitor& v) {
    v.text("base_frame", base_frame, "The robot's frame.");
    v.text("odom_frame", odom_frame, "Odometry's frame, parent of local_map.");
    v.text("local_map_frame", local_map_frame, "The frame of local_map and motion_estimate.");
    v.flag("publish_tf", publish_tf, "Publish the leaf odom -> local_map.");
    v.number("local_map_rate_hz", local_map_rate_hz, 0.1, 100, "Hz", "local_map, at most.");
    v.number("particlecloud_rate_hz", particlecloud_rate_hz, 0.1, 100, "Hz", "local_particlecloud, at most.");
    v.integer(
        "frames_waiting", frames_waiting, 1, 100, "frames",
        "Frames that wait for odometry to cover their stamp; the oldest is dropped when there are more.");
    v.text("range_errors_file", range_errors_file,
           "What was learned of the depth camera's errors is read from here at the start and kept here (each minute, and at the "
           "end), one file per camera. Empty: every start learns anew.");
  }
};

struct LocalMapperConfig {
  int seed = 1;
  double range_min_m = 0.3;
  double range_max_m = 20.0;
  double scan_free_beyond_m = 0.0;
  double grid_half_size_m = 25.0;
  double local_map_size_m = 20.0;
  TsdfConfig tsdf;
  WindowConfig window;
  FilterConfig filter;
  MotionModelConfig motion;
  SteadyErrorsConfig odometry_errors;
  OdometryTimingConfig odometry_timing;
  OdometryBoundConfig odometry_bound;
  RangeErrorsConfig range_errors;
  ContourConfig contour;
  CloseObstaclesConfig close_obstacles;
  ContinuityConfig continuity;
  LocalMapperRosConfig ros;

  LocalMapperConfig();

  template <class Visitor>
  void visit(Visitor& v) {
    v.integer("seed", seed, 0, 2147483647, "", "Of all random numbers: same input and seed, same bytes.");
    v.number("range_min_m", range_min_m, 0, 5, "m", "Readings nearer than this are ignored.");
    v.number("range_max_m", range_max_m, 1, 100, "m", "Readings farther than this are ignored.");
    v.number("scan_free_beyond_m", scan_free_beyond_m, 0, 100, "m",
             "LaserScan: how far a ray without a return (+Inf) counts as seen free; 0 = it says nothing.");
    v.number("grid_half_size_m", grid_half_size_m, 1, 200, "m",
             "The map reaches at least this far from the robot (rounded up to a power of two of cells).");
    v.number("local_map_size_m", local_map_size_m, 1, 100, "m", "Side of the published local_map.");
    v.group("tsdf", tsdf, "The signed distance grid.");
    v.group("window", window, "What the map remembers.");
    v.group("filter", filter, "The particle filter.");
    v.group("motion", motion, "How wrong odometry may be from step to step.");
    v.group("odometry_timing", odometry_timing, "Odometry whose stamps are off.");
    v.group("odometry_errors", odometry_errors, "How wrong it may be steadily, which the filter learns.");
    v.group("odometry_bound", odometry_bound, "How far from it alignment may lead where little is in view.");
    v.group("range_errors", range_errors, "How wrong the depth camera may be steadily, which the mapper learns.");
    v.group("contour", contour, "The virtual 360-degree scan.");
    v.group("close_obstacles", close_obstacles, "Who stands too near for the camera to see.");
    v.group("continuity", continuity, "Gaps, jumps and being carried.");
    v.group("ros", ros, "Frames and rates of the nodelet; no effect offline.");
  }
  /// One sentence per fault, empty if none.
  std::vector<std::string> validate() const;
};

}  // namespace knav
