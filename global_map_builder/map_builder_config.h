#pragma once

#include <string>
#include <vector>

#include "global_map_builder/dense_tsdf.h"
#include "global_map_builder/graph_optimizer.h"
#include "global_map_builder/submap_matcher.h"

namespace knav {

/// Which frames are kept, and how far the mapper's motion is trusted from one keyframe to the next.
struct DriveConfig {
  double frame_distance_m = 0.03;
  double frame_angle_deg = 1.0;
  double frame_period_s = 1.0;
  double keyframe_distance_m = 0.25;
  double keyframe_angle_deg = 8.0;
  double scan_keyframe_distance_m = 0.1;
  double scan_keyframe_angle_deg = 4.0;
  double scan_stamp_sd_s = 0.03;
  int mapper_threads = 2;
  double position_sd_per_m = 0.02;
  double position_sd_floor_m = 0.0025;
  double heading_sd_deg_per_m = 0.4;
  double heading_sd_per_turn = 0.01;
  double filter_share = 0.05;
  double doubt_before_break_s = 4.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("frame_distance_m", frame_distance_m, 0, 10, "m", "A frame is kept after this distance ...");
    v.number("frame_angle_deg", frame_angle_deg, 0, 180, "deg", "... or this turn ...");
    v.number("frame_period_s", frame_period_s, 0, 3600, "s", "... or this time.");
    v.number("keyframe_distance_m", keyframe_distance_m, 0.05, 10, "m",
             "A node of the graph after this distance ...");
    v.number("keyframe_angle_deg", keyframe_angle_deg, 1, 180, "deg", "... or this turn.");
    v.number("scan_keyframe_distance_m", scan_keyframe_distance_m, 0.05, 10, "m",
             "The same of a scanner, whose every frame is good enough to be fitted by itself: this distance ...");
    v.number("scan_keyframe_angle_deg", scan_keyframe_angle_deg, 1, 180, "deg", "... or this turn.");
    v.number("scan_stamp_sd_s", scan_stamp_sd_s, 0, 1, "s",
             "local_mapper/odometry_timing/stamp_sd_s of a drive recorded with a scanner, unless that is more.");
    v.integer("mapper_threads", mapper_threads, 1, 64, "",
              "local_mapper/tsdf/threads and filter/threads while a drive is mapped, unless they are more.");
    v.number("position_sd_per_m", position_sd_per_m, 1e-4, 1, "m/m",
             "Position error (sd) of the local mapper per distance, of one metre; grows as the root of the "
             "distance.");
    v.number("position_sd_floor_m", position_sd_floor_m, 1e-4, 1, "m",
             "Position error (sd) of a step, at least.");
    v.number("heading_sd_deg_per_m", heading_sd_deg_per_m, 1e-3, 45, "deg/m", "Heading error, likewise.");
    v.number("heading_sd_per_turn", heading_sd_per_turn, 0, 1, "rad/rad",
             "Heading error (sd) per angle turned.");
    v.number("filter_share", filter_share, 0, 1, "",
             "Share of the mapper's own covariance that is added to a step's.");
    v.number("doubt_before_break_s", doubt_before_break_s, 0, 60, "s",
             "When the mapper lost the thread, steps of this long before are trusted little.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// Where two visits of one place are looked for.
struct ClosureConfig {
  bool automatic = true;
  bool buttons = true;
  double submap_half_length_m = 5.0;
  double submap_spacing_m = 1.5;
  double submap_range_max_m = 10.0;
  double min_path_m = 12.0;
  double search_base_m = 1.0;
  double search_per_m = 0.03;
  double search_max_m = 8.0;
  double search_angle_base_deg = 6.0;
  double search_angle_deg_per_m = 0.25;
  double search_angle_max_deg = 40.0;
  double button_sd_m = 0.3;
  double nearest_m = 4.0;
  double max_innovation = 40.0;
  int passes = 2;
  double locate_spacing_m = 3.0;
  int locate_agreeing = 3;
  double allowed_sd_m = 0.05;
  double allowed_sd_deg = 0.5;
  double fitted_max_m = 0.4;
  double fitted_max_deg = 3.0;
  double falsify_share = 0.0;
  int falsify_seed = 1;
  MatchConfig match;

  template <class Visitor>
  void visit(Visitor& v) {
    v.flag("automatic", automatic, "Look for closures by matching local maps.");
    v.flag("buttons", buttons, "Use the marks set while driving.");
    v.number("submap_half_length_m", submap_half_length_m, 0.5, 50, "m",
             "A local map holds what was seen from this far before a keyframe to this far after it.");
    v.number("submap_spacing_m", submap_spacing_m, 0.2, 50, "m", "Local maps every so far along the path.");
    v.number("submap_range_max_m", submap_range_max_m, 1, 50, "m", "They hold readings up to this range.");
    v.number("min_path_m", min_path_m, 1, 1000, "m",
             "Two visits lie at least this far apart along the path.");
    v.number("search_base_m", search_base_m, 0.1, 50, "m", "The search reaches this far ...");
    v.number("search_per_m", search_per_m, 0, 1, "m/m",
             "... plus this per distance driven since the last common point ...");
    v.number("search_max_m", search_max_m, 0.1, 50, "m", "... at most.");
    v.number("search_angle_base_deg", search_angle_base_deg, 0, 180, "deg", "Likewise for the heading.");
    v.number("search_angle_deg_per_m", search_angle_deg_per_m, 0, 10, "deg/m", "Likewise for the heading.");
    v.number("search_angle_max_deg", search_angle_max_deg, 0, 180, "deg", "Likewise for the heading.");
    v.number("button_sd_m", button_sd_m, 0.01, 5, "m",
             "How well the robot is put back at a marked place (sd).");
    v.number("nearest_m", nearest_m, 0.1, 50, "m",
             "Local maps farther apart than this (and the search) are not compared.");
    v.number("max_innovation", max_innovation, 1, 1e6, "",
             "A closure that makes the graph's chi2 grow by more is refused: the drive cannot have been so "
             "wrong.");
    v.integer("passes", passes, 1, 5, "",
              "Passes over the drive; each starts from the graph that the last one left.");
    v.number(
        "locate_spacing_m", locate_spacing_m, 0.5, 50, "m",
        "A further drive is sought among local maps of the earlier ones every so far, with its own every "
        "so far too.");
    v.integer("locate_agreeing", locate_agreeing, 2, 100, "",
              "So many of its places must agree on where it lies.");
    v.number("allowed_sd_m", allowed_sd_m, 0.001, 5, "m",
             "How well a closure of the user's list is trusted (sd).");
    v.number("allowed_sd_deg", allowed_sd_deg, 0.01, 90, "deg", "Likewise its heading.");
    v.number("fitted_max_m", fitted_max_m, 0.05, 100, "m",
             "A closure that lies farther than this from where the visits are once all views are fitted is refused after all, ...");
    v.number("fitted_max_deg", fitted_max_deg, 0.5, 180, "deg", "... and one that is turned more.");
    v.number("falsify_share", falsify_share, 0, 1, "",
             "For measuring robustness: this share of the closures found is moved by metres on purpose.");
    v.integer("falsify_seed", falsify_seed, 0, 1000000, "", "Which ones.");
    v.group("match", match, "When a match counts.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// Finding and mending the mapper's jumps, with edges between keyframes a few metres apart by direct
/// alignment.
struct RefinementConfig {
  bool enabled = false;
  double half_length_m = 0.5;
  double range_max_m = 8.0;
  std::vector<double> spans_m = {1.5, 3.0, 6.0};
  double max_change_m = 0.3;
  double position_sd_m = 0.03;
  double heading_sd_deg = 0.6;
  double odometry_sd_factor = 1.5;
  double jump_chi2 = 20.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.flag("enabled", enabled, "Look for jumps of the mapper and mend them.");
    v.number("half_length_m", half_length_m, 0.05, 10, "m",
             "What was seen this far before and after a keyframe.");
    v.number("range_max_m", range_max_m, 1, 50, "m", "Readings up to this range.");
    v.list("spans_m", spans_m, "m", "Distances along the drive between the keyframes that are aligned.");
    v.number("max_change_m", max_change_m, 0.01, 5, "m",
             "An alignment farther from the mapper's estimate is ignored.");
    v.number("position_sd_m", position_sd_m, 1e-3, 1, "m", "How well such an alignment is trusted (sd).");
    v.number("heading_sd_deg", heading_sd_deg, 0.01, 20, "deg", "How well its heading is trusted (sd).");
    v.number("odometry_sd_factor", odometry_sd_factor, 0.1, 100, "",
             "Odometry is trusted to this times its usual deviation from the mapper.");
    v.number("jump_chi2", jump_chi2, 1, 1e9, "",
             "A step of the mapper that parts from odometry by more than this (squared, in usual deviations) "
             "is a jump.");
  }
  std::vector<std::string> validate() const {
    for (const double span : spans_m) {
      if (!(span > 2.0 * half_length_m))
        return {"refinement/spans_m must each exceed twice refinement/half_length_m."};
    }
    return {};
  }
};

/// Setting right single keyframes of a scanner's drive, before the closures.
struct SettlingConfig {
  bool enabled = true;
  double span_m = 3.0;
  double max_turn_deg = 30.0;
  double turn_step_deg = 2.0;
  double max_move_m = 0.5;
  double min_gain = 1.2;
  int passes = 2;

  template <class Visitor>
  void visit(Visitor& v) {
    v.flag("enabled", enabled, "Try each keyframe of a scanner at other headings.");
    v.number("span_m", span_m, 0.2, 20, "m", "Against those up to this far along the drive, ...");
    v.number("max_turn_deg", max_turn_deg, 0, 90, "deg", "... turned by up to this, ...");
    v.number("turn_step_deg", turn_step_deg, 0.2, 10, "deg", "... in such steps.");
    v.number("max_move_m", max_move_m, 0, 5, "m", "One that would have to move farther than this stays.");
    v.number("min_gain", min_gain, 1, 10, "", "So many times as many of its points must fit.");
    v.integer("passes", passes, 1, 10, "", "Times, for neighbours that were wrong too.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// Bending the whole drive until all that was seen fits together, after the closures.
struct JointRefinementConfig {
  bool enabled = true;
  int max_partners = 60;
  double min_path_m = 0.1;
  double max_apart_m = 20.0;
  double min_shared = 0.06;
  double gate_m = 0.4;
  double merge_m = 0.06;
  double merge_deg = 4.6;
  double far_m = 8.0;
  double point_weight = 0.06;
  double scan_point_weight = 0.3;
  double step_across_share = 0.3;
  double step_heading_share = 0.5;
  double odometry_sd_per_m = 0.025;
  double offset_sd_per_m = 0.001;
  double common_offset_sd_per_m = 5.6e-5;
  int rounds = 2;
  int steps = 6;

  template <class Visitor>
  void visit(Visitor& v) {
    v.flag("enabled", enabled, "Fit all keyframes' views together.");
    v.integer("max_partners", max_partners, 1, 1000, "",
              "Each keyframe is compared with so many earlier ones, spread evenly over those that see the same.");
    v.number("min_path_m", min_path_m, 0.1, 100, "m", "Keyframes nearer than this along the drive are not compared.");
    v.number("max_apart_m", max_apart_m, 1, 100, "m", "Neither are those farther apart than this.");
    v.number("min_shared", min_shared, 0.05, 1, "", "Share of a view that the other must see.");
    v.number("gate_m", gate_m, 0.05, 5, "m", "Surfaces farther apart than this are two.");
    v.number("merge_m", merge_m, 0, 1, "m",
             "A depth camera's frames up to this far along the drive on both sides of a keyframe are averaged, ...");
    v.number("merge_deg", merge_deg, 0, 45, "deg", "... if they look the same way up to this angle.");
    v.number("far_m", far_m, 1, 1000, "m",
             "A depth camera's reading from so far counts a quarter of what its noise alone would let it: what is steadily wrong with it "
             "is the same for a whole wall.");
    v.number("point_weight", point_weight, 1e-4, 10, "",
             "Weight of a depth camera's point beside the graph's edges: neighbouring readings and frames share their errors.");
    v.number("scan_point_weight", scan_point_weight, 1e-4, 10, "", "The same of a scanner's point.");
    v.number("step_across_share", step_across_share, 0.01, 1, "",
             "A depth camera's steps from keyframe to keyframe are trusted, across the way, to this share of drive/position_sd_per_m, ...");
    v.number("step_heading_share", step_heading_share, 0.01, 1, "", "... and their heading to this share of drive/heading_sd_deg_per_m.");
    v.number("odometry_sd_per_m", odometry_sd_per_m, 0, 1, "m/m",
             "How well odometry tells the length of one metre driven (sd), but for a scale that is the same over the drive and is found; grows "
             "as the root of the distance. 0 = it is not asked.");
    v.number("offset_sd_per_m", offset_sd_per_m, 1e-7, 0.05, "1/m",
             "How wrong a depth camera's disparity may steadily be, column against column (sd; 0.001 is 1 % at 10 m).");
    v.number("common_offset_sd_per_m", common_offset_sd_per_m, 1e-7, 0.05, "1/m",
             "The same of all columns alike, which only odometry's constant scale tells from a bent drive.");
    v.integer("rounds", rounds, 1, 100, "", "Times that views are paired anew.");
    v.integer("steps", steps, 1, 100, "", "Steps a round.");
  }
  std::vector<std::string> validate() const { return {}; }
};

struct MapBuilderConfig {
  DriveConfig drive;
  RefinementConfig refinement;
  SettlingConfig settling;
  ClosureConfig closures;
  GraphOptimizerConfig graph;
  JointRefinementConfig joint;
  SurfaceConfig surface;
  double min_contour_piece_m = 0.25;
  double robot_radius_m = 0.20;
  double driven_margin_m = 0.08;
  std::string distance = "exact";
  double size_max_m = 400.0;
  double min_change_m = 0.3;

  template <class Visitor>
  void visit(Visitor& v) {
    v.group("drive", drive, "Frames, keyframes and the edges between them.");
    v.group("refinement", refinement, "Direct alignment along the drive.");
    v.group("settling", settling, "Single keyframes of a scanner that are turned wrongly.");
    v.group("closures", closures, "Visits of the same place.");
    v.group("graph", graph, "The optimiser.");
    v.group("joint", joint, "Fitting all views together.");
    v.group("surface", surface, "The map's signed distance grid.");
    v.number("min_contour_piece_m", min_contour_piece_m, 0, 5, "m", "Shorter pieces of contour are noise.");
    v.number("robot_radius_m", robot_radius_m, 0, 2, "m",
             "Ground that the robot's body, a disc, was on is free, though the Kinect sees none of it; 0 = "
             "it says nothing.");
    v.number("driven_margin_m", driven_margin_m, 0, 0.5, "m",
             "Ground this far beside the body is free too where nobody has seen what is there: a planner that keeps its distance from "
             "what is unknown could not follow the way that the robot has driven.");
    v.choice("distance", distance, {"exact", "paper"},
             "exact: distance transform of the contour. paper: ray tracing from every cell (minutes).");
    v.number("size_max_m", size_max_m, 5, 2000, "m",
             "A map larger than this in either direction is refused as an error.");
    v.number("min_change_m", min_change_m, 0.05, 10, "m",
             "Extending a map reports surfaces that came or went from this length on.");
  }
  std::vector<std::string> validate() const {
    std::vector<std::string> faults = refinement.validate();
    if (drive.keyframe_distance_m < drive.frame_distance_m) {
      faults.push_back("drive/keyframe_distance_m must not be below drive/frame_distance_m.");
    }
    if (drive.scan_keyframe_distance_m < drive.frame_distance_m) {
      faults.push_back("drive/scan_keyframe_distance_m must not be below drive/frame_distance_m.");
    }
    return faults;
  }
};

}  // namespace knav
