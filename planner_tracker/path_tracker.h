#pragma once

#include <vector>

#include "core/pose2.h"
#include "planner_tracker/combined_map.h"
#include "planner_tracker/path.h"
#include "planner_tracker/planner_tracker_config.h"
#include "planner_tracker/scan_view.h"
#include "planner_tracker/walkers.h"

namespace knav {

/// What a control step has to go by.
struct TrackInput {
  Pose2 T_map_base;
  double v_mps = 0.0, w_radps = 0.0;  ///< commanded last
  double dt_s = 0.05;
  const MapLayer* layer = nullptr;  ///< the combined map; null where only the scan is to be believed
  const CombinedMap* map = nullptr;  ///< whose newest local map says what has been seen; may be null
  const ScanView* scan = nullptr;
  const std::vector<Point2>* moving = nullptr;  ///< in the map: what moves or has just appeared; may be null
  const std::vector<Walker>* walkers = nullptr;  ///< in the map: where those who walk are expected now; may be null
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

  /// A disc that holds the footprint whichever way it faces, and the margin under which nothing must come.
  double safe_radius_m() const { return outline_.circumscribed_m() + margin_m_; }
  /// How far the robot may go straight in a direction of its frame [m], at most `length_m`.
  double straight_free_m(const TrackInput& input, double bearing_rad, double length_m) const;
  /// How far the robot may turn on the spot [rad], to the left (+1) or right (-1), at most `most_rad`.
  double turn_free_rad(const TrackInput& input, double side, double most_rad) const;
  /// How far an arc may be driven [m], at most up to `length_m`; its least clearance within `near_m`; and how fast one may go
  /// now, so that wherever it is narrow the robot has slowed down to what clearance allows there.
  struct Rollout {
    double free_m = 0.0, least_clearance_m = 0.0, speed_mps = 0.0;
    double end_x_m = 0.0, end_y_m = 0.0;  ///< in the robot's frame, where it stopped being free
  };
  Rollout roll_out(const TrackInput& input, double curvature_radpm, double length_m, double near_m,
                   bool backwards) const;

 private:
  /// Of a point in the robot's frame, to what scan or map has there.
  double point_clearance_m(const TrackInput& input, double x_m, double y_m) const;
  /// The same for a robot in this pose of its present frame: what a disc of the inscribed radius would need to have just
  /// as much room as the footprint has.
  double clearance_m(const TrackInput& input, double x_m, double y_m, double yaw_rad) const;
  /// Where no arc from the robot's heading is free, as beside a corner that it touches all but: the heading next to the path's from
  /// which it can go straight on past that; 0 if there is none.
  double bearing_past(const TrackInput& input, double bearing_rad) const;
  /// True while the robot is on its straight way past that. Who let the path steer again right after the turn would be led back
  /// to the corner, and turn to and fro before it.
  bool still_passes(const TrackInput& input) const;
  /// True if the arc to this point of the robot's frame sweeps ground that the local map has not seen.
  bool sweeps_unseen(const TrackInput& input, const Point2& target) const;
  /// What this clearance_m() allows: slow_mps at the hard clearance, max_vel_x from the preferred one on.
  double speed_at_mps(double clearance_m) const;
  /// What lets the robot be down to that speed this far ahead, at acc_lim_x after reaction_s.
  double speed_before_mps(double distance_m, double then_mps) const;
  /// What moves nearby allows.
  double speed_near_moving_mps(const TrackInput& input, const Rollout& ahead) const;
  /// True if somebody who walks where the camera does not look will come too near to a robot that drives this arc.
  bool meets_a_walker(const TrackInput& input, double curvature_radpm, double v_mps, double reach_m) const;
  /// True off the cells the map calls free. A robot that stands in the midst of unknown keeps clearance 0
  /// wherever it goes, so that a rule of not coming nearer would not hold it. Half its radius is let pass (it
  /// stands there), too little to creep on by.
  bool unknown_ground(const TrackInput& input, double x_m, double y_m) const;
  double approach(double from, double to, double step) const;

  PlannerTrackerConfig config_;
  Footprint outline_;
  double margin_m_;       ///< nothing may come nearer to the footprint
  double stop_radius_m_;  ///< the same as a clearance_m()
  double hard_radius_m_, preferred_radius_m_;
  bool turning_ = false;
  bool passing_ = false;
  Point2 past_;  ///< passing_: in the map, where to
};

}  // namespace knav
