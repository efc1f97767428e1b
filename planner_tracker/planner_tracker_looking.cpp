// Standing before a way that is closed for now: where the robot looks at it from.
#include <algorithm>
#include <cmath>

#include "planner_tracker/planner_tracker_state.h"

namespace knav {
namespace {

constexpr double kArrived_m = 0.15;
constexpr double kStillThere_m = 0.3;      ///< once arrived: the pose's noise must not begin the looking anew
constexpr double kFacing_rad = 0.2;
constexpr double kStandsBefore_m = 0.8;    ///< what closes the way, and the robot's radius, reach this far before the point
constexpr double kEnoughFarther_m = 0.15;  ///< less is not worth backing up for
constexpr double kLongEnough_s = 3.0;      ///< looked from one place: what has gone is gone from the map within 1 s of being seen
constexpr double kFreeBehind_m = 0.25;
constexpr double kJustDriven_s = 12.0, kBesideTrack_m = 0.1;

}  // namespace

bool PlannerTracker::State::looking(double now_s, const RobotState& robot) {
  const Path& path = keeper.path();
  const Point2 p = robot.T_map_base.inverse() * keeper.at();
  const double distance = std::hypot(p.x_m, p.y_m), bearing = std::atan2(p.y_m, p.x_m);
  const bool closed = outcome == PlanKeeper::Outcome::kToBlockage;
  const bool arrived = path.remaining_m() + path.offset_m() < (standing_since_s < 0.0 ? kArrived_m : kStillThere_m);
  const bool in_view = closed && distance < config.planning.look_distance_m + kArrived_m &&
                       tracker.straight_free_m(input, bearing, distance) > distance - kStandsBefore_m;
  const bool holding = keeper.holding();
  // On its way to another place to look from: it has seen all there is to see from here.
  if (keeper.elsewhere() && !arrived) return false;
  if (in_view && !holding && backing_up(now_s, robot, keeper.at())) return true;
  if (!arrived && (!in_view || (!holding && distance < config.planning.too_near_m()))) return false;
  if (looking_since_s < 0.0) looking_since_s = now_s;
  if (standing_since_s < 0.0) standing_since_s = now_s;
  if ((closed || outcome == PlanKeeper::Outcome::kToNearby) && !holding && now_s - looking_since_s > kLongEnough_s) {
    // Nothing new from here: what hides the place from here may not hide it from there.
    keeper.look_elsewhere();
    next_plan_s = now_s;
    looking_since_s = -1.0;
  }
  act(Activity::kWaiting, std::abs(bearing) > kFacing_rad ? tracker.turn(input, bearing) : tracker.stop(input));
  return true;
}

/// How far straight behind it the robot came along within the last seconds: seen free, and driven.
double PlannerTracker::State::just_driven_behind_m(const Pose2& T_odom_base) const {
  double driven_m = 0.0;
  if (odometry.empty()) return driven_m;
  const double newest_s = odometry.newest_s();
  for (double stamp_s = newest_s; stamp_s > newest_s - kJustDriven_s; stamp_s -= 0.1) {
    Pose2 T_odom_then;
    if (odometry.at(stamp_s, 1.0, 0.0, &T_odom_then) != PoseBuffer::Lookup::kOk) break;
    const Pose2 then = T_odom_base.inverse() * T_odom_then;
    if (std::abs(then.y_m) > kBesideTrack_m) break;
    driven_m = std::max(driven_m, -then.x_m);
  }
  return driven_m;
}

/// Something stands nearer than a level Kinect sees the floor: whether it goes, cannot be seen from here, and in a door
/// nobody gets past the robot. Backs up with its eyes on it.
bool PlannerTracker::State::backing_up(double now_s, const RobotState& robot, const Point2& from) {
  const Point2 p = robot.T_map_base.inverse() * from;
  const double missing_m = config.planning.look_distance_m - std::hypot(p.x_m, p.y_m);
  const bool facing = std::abs(std::atan2(p.y_m, p.x_m)) < 2.0 * kFacing_rad;
  const bool moving = input.v_mps < -0.01;
  if (config.planning.back_up_after_s <= 0.0 || config.min_vel_x >= 0.0 || !facing ||
      missing_m < (moving ? 0.03 : kEnoughFarther_m)) {
    near_since_s = -1.0;
    return false;
  }
  const double behind_m =
      std::min(scan.free_m(kPi, tracker.safe_radius_m(), false), just_driven_behind_m(robot.T_odom_base));
  if (behind_m < (moving ? 0.1 : kFreeBehind_m)) return false;
  if (near_since_s < 0.0) near_since_s = now_s;
  if (now_s - near_since_s < config.planning.back_up_after_s) {
    act(Activity::kWaiting, tracker.stop(input));
    return true;
  }
  const TrackOutput back = tracker.creep(input, -std::min(missing_m, behind_m - 0.05));
  if (back.kind == TrackOutput::Kind::kBlocked) return false;
  act(Activity::kBackingUp, back);
  return true;
}

}  // namespace knav
