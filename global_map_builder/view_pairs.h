#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/pose2.h"
#include "global_map_builder/drive_view.h"
#include "global_map_builder/map_builder_config.h"

namespace knav {

/// Two keyframes that see the same surfaces.
struct ViewPair {
  int from = 0, to = 0;
};

/// The normal equations of one pair: poses of `from` (x, y, yaw) and `to` in the map, then the offset's knots of
/// from's drive and of to's.
struct PairEquations {
  static constexpr int kOffset = 6, kSize = 6 + 2 * RangeOffset::kKnots;
  Eigen::Matrix<double, kSize, kSize> H;
  Eigen::Matrix<double, kSize, 1> g;
  double cost = 0.0;  ///< robust, a point at most 1
  int points = 0;
  double weight = 0.0;  ///< of the points together
};

/// All pairs worth comparing: each keyframe with up to max_partners earlier ones, spread evenly over those that
/// see enough of what it sees.
std::vector<ViewPair> find_view_pairs(const JointRefinementConfig& config, const std::vector<DriveView>& views,
                                      const std::vector<Pose2>& T_map_keyframe, const std::vector<double>& path_m);

/// @param fade_sd  a point that is off by so many standard deviations counts a quarter
/// @param gate_m  points farther than this from the other's surface are not of it
void compare_views(const DriveView& from, const DriveView& to, const Pose2& T_map_from, const Pose2& T_map_to,
                   double gate_m, double fade_sd, PairEquations* equations);

}  // namespace knav
