#include "tools/parked_accuracy.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr double kStill_m = 0.002, kStill_rad = 0.002;
constexpr double kSettled_s = 1.0, kMinute_s = 60.0;
constexpr double kGap_s = 1.0;

/// First and last pose of the longest stretch on which nothing moves.
std::pair<std::size_t, std::size_t> longest_stop(const Trajectory& truth) {
  std::pair<std::size_t, std::size_t> longest{0, 0};
  std::size_t first = 0;
  for (std::size_t i = 1; i < truth.size(); ++i) {
    const Pose2 T_first_now = truth[first].T_map_robot.inverse() * truth[i].T_map_robot;
    const bool still = std::hypot(T_first_now.x_m, T_first_now.y_m) < kStill_m && std::abs(T_first_now.yaw_rad) < kStill_rad;
    if (!still) first = i;
    if (truth[i].stamp_s - truth[first].stamp_s > truth[longest.second].stamp_s - truth[longest.first].stamp_s) longest = {first, i};
  }
  return longest;
}

double mean_share(const std::vector<ScanShare>& shares, double from_s, double to_s) {
  double sum = 0.0;
  int count = 0;
  for (const ScanShare& s : shares) {
    if (s.stamp_s < from_s || s.stamp_s > to_s) continue;
    sum += s.seen;
    ++count;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

ParkedAccuracy parked_accuracy(const Trajectory& estimate, const Trajectory& truth, const std::vector<ScanShare>& shares) {
  ParkedAccuracy accuracy;
  if (truth.empty()) return accuracy;
  const auto [first, last] = longest_stop(truth);
  const double from_s = truth[first].stamp_s + kSettled_s, to_s = truth[last].stamp_s;
  Pose2 T_map_stop;
  if (to_s <= from_s || !interpolate_at(estimate, from_s, kGap_s, &T_map_stop)) return accuracy;
  accuracy.parked_s = to_s - truth[first].stamp_s;
  for (const StampedPose2& pose : estimate) {
    if (pose.stamp_s < from_s || pose.stamp_s > to_s) continue;
    const Pose2 T_stop_now = T_map_stop.inverse() * pose.T_map_robot;
    accuracy.moved_m = std::max(accuracy.moved_m, std::hypot(T_stop_now.x_m, T_stop_now.y_m));
    accuracy.turned_deg = std::max(accuracy.turned_deg, std::abs(T_stop_now.yaw_rad) * 180.0 / kPi);
  }
  double driven_m = 0.0;
  std::size_t later = last;
  while (later + 1 < truth.size() && driven_m < ParkedAccuracy::kLater_m) {
    driven_m += distance_m(truth[later].T_map_robot, truth[later + 1].T_map_robot);
    ++later;
  }
  Pose2 T_map_later;
  if (interpolate_at(estimate, truth[later].stamp_s, kGap_s, &T_map_later)) {
    const Pose2 T_stop_later = T_map_stop.inverse() * T_map_later;
    const Pose2 T_stop_truly = truth[last].T_map_robot.inverse() * truth[later].T_map_robot;
    accuracy.later_m = distance_m(T_stop_later, T_stop_truly);
  }
  accuracy.seen_before = mean_share(shares, from_s, from_s + kMinute_s);
  accuracy.seen_after = mean_share(shares, to_s - kMinute_s, to_s);
  return accuracy;
}

}  // namespace knav
