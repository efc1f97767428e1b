#pragma once

#include <cstdint>
#include <functional>

#include "core/pose2.h"
#include "planner_tracker/path_tracker.h"

namespace knav {

/// The paper's reactive obstacle avoidance (section III.H): a short sequence of random rotations and
/// translations towards open space. Same seed and situation, same moves.
class RandomMoves {
 public:
  /// How far the robot may go straight in a direction of its own frame [m].
  using FreeWay = std::function<double(double bearing_rad)>;

  RandomMoves(const PlannerTrackerConfig& config, const PathTracker& tracker)
      : config_(config), tracker_(&tracker) {}

  /// Of the translations.
  struct Stride {
    double shortest_m, longest_m;
    double open_enough_m;  ///< a direction more open than this is not better
    double speed_mps;
  };

  /// Begins a sequence. @param count of rotation and translation pairs
  void start(int count, const Stride& stride);
  bool active() const { return left_ > 0; }
  void end() { left_ = 0; }

  /// One control step of the sequence, which ends (active() turns false) when done or nothing is open.
  TrackOutput step(const TrackInput& input, const Pose2& T_odom_base, const FreeWay& free_way);

 private:
  void choose(const Pose2& T_odom_base, const FreeWay& free_way);
  void next();

  PlannerTrackerConfig config_;
  const PathTracker* tracker_;
  std::uint64_t sequence_ = 0;  ///< the random stream's step: never the same moves twice in a run
  std::uint32_t move_ = 0;
  int left_ = 0;
  Stride stride_{};
  enum class Phase { kChoose, kTurn, kGo } phase_ = Phase::kChoose;
  Pose2 T_odom_start_;
  double heading_odom_rad_ = 0.0;
  double distance_m_ = 0.0;
  double spent_s_ = 0.0;
};

}  // namespace knav
