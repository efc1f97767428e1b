#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/distance_map.h"
#include "core/grid_geometry.h"
#include "core/pose2.h"
#include "core/range_scan.h"
#include "planner_tracker/combined_map.h"
#include "planner_tracker/grid_planner.h"
#include "planner_tracker/planner_tracker_config.h"

namespace knav {

/// What the tracker knows about localization; kUnknown = nobody reports it, and the pose is trusted.
enum class LocalizationState { kUnknown, kOk, kUncertain, kLost, kInitializing };

/// The robot, as known at a control step.
struct RobotState {
  bool has_pose = false;  ///< T_map_base is known at all
  double pose_stamp_s = 0.0;
  Pose2 T_map_base;
  double odom_stamp_s = 0.0;
  Pose2 T_odom_base;
  double v_mps = 0.0;  ///< from odometry
  double w_radps = 0.0;
  LocalizationState localization = LocalizationState::kUnknown;
  double localization_stamp_s = 0.0;
};

/// What the robot is doing; to_string() gives the words for feedback and log.
enum class Activity {
  kIdle,  ///< no goal
  kDriving,
  kTurning,      ///< in place, towards the path
  kAligning,     ///< in place, at the goal
  kWaiting,      ///< something is in the way
  kApproaching,  ///< the way is closed further on; goes there to look
  kBackingUp,    ///< from something too near to be seen well
  kAvoiding,     ///< reactive avoidance
  kStopped,      ///< data missing
  kLostTurning,  ///< not localized: looks round
  kLostWandering,
  kReached,
  kFailed,
};
const char* to_string(Activity activity);

/// The codes of kinect_nav/NavigationFailure.
enum class FailureCode : std::uint8_t {
  kNone = 0,
  kGoalInvalid = 1,
  kGoalOccupied = 2,
  kGoalUnknown = 3,
  kNoPath = 4,
  kBlocked = 5,
  kLost = 6,
  kNoSensorData = 7,
  kStartOccupied = 8,
};

struct Failure {
  FailureCode code = FailureCode::kNone;
  std::string reason;  ///< a sentence
  Point2 at;           ///< the offending point in the map
};

struct Command {
  double v_mps = 0.0;
  double w_radps = 0.0;
  Activity activity = Activity::kIdle;
  bool finished = false;  ///< in this step the goal ended: kReached, or kFailed with failure()
};

/// Takes the robot to goals over the combined map (paper section III.H). No ROS, one thread, no clock of its
/// own: the same calls give the same commands. Never asks for motion without a goal.
class PlannerTracker {
 public:
  /// Throws UserError if the configuration is not valid.
  explicit PlannerTracker(const PlannerTrackerConfig& config);
  ~PlannerTracker();
  PlannerTracker(const PlannerTracker&) = delete;
  PlannerTracker& operator=(const PlannerTracker&) = delete;

  /// A new global map; any part may be empty but one of distance and occupancy. A goal goes on, on the new
  /// map.
  void set_map(const DistanceMap& distance, const OccupancyGrid& occupancy, const OccupancyGrid& keepout);
  /// The newest local map and where it lies. Before set_map() it has no effect.
  void set_local_map(const OccupancyGrid& local, const Pose2& T_map_local);
  /// Forgets what the local maps said; the next one brings it back.
  void clear_local_map();
  /// The newest scan_360. Its stamp should lie within the odometry given to step().
  void set_scan(const RangeScan& scan, const Pose2& T_base_sensor);

  /// A new goal replaces the old. Returns false, with failure(), if it is not finite or cannot be.
  bool set_goal(const Pose2& T_map_goal);
  /// The robot stops at the next step.
  void cancel();
  bool has_goal() const;
  const Pose2& goal() const;

  /// One control step; times in seconds of the stamps' clock. A clock that jumps back ends the goal.
  Command step(double now_s, const RobotState& robot);

  const Failure& failure() const;           ///< of the last goal
  const std::string& explanation() const;   ///< why the robot does what it does, a sentence; "" = as planned
  const std::vector<Point2>& path() const;  ///< being followed, from the robot on; empty if none
  const CombinedMap& map() const;
  std::size_t plans() const;  ///< made so far
  /// A plan on the combined map between two points, for make_plan; does not touch the goal.
  PlanResult make_plan(const Point2& start, const Point2& goal, double tolerance_m);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace knav
