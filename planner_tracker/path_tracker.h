#pragma once

#include "core/pose2.h"
#include "planner_tracker/combined_map.h"
#include "planner_tracker/path.h"
#include "planner_tracker/planner_tracker_config.h"
#include "planner_tracker/scan_view.h"

namespace knav {

/// What a control step has to go by.
struct TrackInput {
  Pose2 T_map_base;
  double v_mps = 0.0, w_radps = 0.0;  ///< commanded last
  double dt_s = 0.05;
  const MapLayer* layer = nullptr;  ///< the combined map
  const ScanView* scan = nullptr;
};

struct TrackOutput {
  enum class Kind { kDriving, kTurning, kBlocked };
  Kind kind = Kind::kDriving;
  double v_mps = 0.0, w_radps = 0.0;
  Point2 obstacle;  ///< kBlocked: where on the map the way ends
};

/// Follows a path: steers an arc at a point a little ahead, looked along first by a rollout of the footprint
/// through scan and map; turns in place where that point lies outside of what the camera sees.
class PathTracker {
 public:
  explicit PathTracker(const PlannerTrackerConfig& config);

  void reset();
  /// @param path advanced to the robot's place
  TrackOutput follow(const TrackInput& input, const Path& path);
  /// Turns in place by this much; brakes first.
  TrackOutput turn(const TrackInput& input, double error_rad) const;
  /// Straight on or back over this distance (negative: back) towards a point close by.
  TrackOutput creep(const TrackInput& input, double distance_m) const;
  /// Brakes within the limits.
  TrackOutput stop(const TrackInput& input) const;

  /// The distance to anything, seen or known, under which the footprint must not come.
  double stop_radius_m() const { return stop_radius_m_; }
  /// Of a point in the robot's frame, to what scan or map has there.
  double clearance_m(const TrackInput& input, double x_m, double y_m) const;
  /// How far the robot may go straight in a direction of its frame [m], at most `length_m`.
  double straight_free_m(const TrackInput& input, double bearing_rad, double length_m) const;
  /// How far an arc may be driven [m], at most up to `length_m`; and its least clearance within `near_m`.
  struct Rollout {
    double free_m = 0.0, least_clearance_m = 0.0;
    double end_x_m = 0.0, end_y_m = 0.0;  ///< in the robot's frame, where it stopped being free
  };
  Rollout roll_out(const TrackInput& input, double curvature_radpm, double length_m, double near_m,
                   bool backwards) const;

 private:
  /// True off the cells the map calls free. A robot that stands in the midst of unknown keeps clearance 0
  /// wherever it goes, so that a rule of not coming nearer would not hold it. Half its radius is let pass (it
  /// stands there), too little to creep on by.
  bool unknown_ground(const TrackInput& input, double x_m, double y_m) const;
  double approach(double from, double to, double step) const;

  PlannerTrackerConfig config_;
  double stop_radius_m_;
  bool turning_ = false;
};

}  // namespace knav
