#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "synthetic_building.h"
#include "tsdf_localizer/localizer.h"

namespace knav {
namespace {

using test::Building;
using V = LocalizationVerdict;

constexpr double kRate_hz = 8.0;

TEST(LocalizerTakenAway, WhereAnArmchairStoodWhenItWasMappedATrackedRobotKeepsItsPose) {
  // It drives to where the armchair stood, turns there twice, as the planner has it do when it is lost, and drives on.
  const Building world = test::office();
  Building mapped = world;
  mapped.wall(3.0, 3.2, 4.0, 4.2);
  Localizer localizer{LocalizerConfig()};
  localizer.set_map(mapped.distance_map());
  std::vector<Pose2> way = test::drive({{8.0, 8.0}, {3.5, 8.0}, {3.5, 3.7}}, kRate_hz);
  const int turning = static_cast<int>(4.0 * kPi * kRate_hz / 0.8);
  const Pose2 there = way.back();
  for (int i = 0; i < turning; ++i) way.push_back(there * Pose2{0.0, 0.0, normalize_angle_rad(4.0 * kPi * i / turning)});
  for (const Pose2& pose : test::drive({{3.5, 3.7}, {3.5, 8.0}, {8.0, 8.0}}, kRate_hz)) way.push_back(pose);
  test::ScanModel kinect;
  kinect.rays = 720;
  kinect.noise_m = 0.01;
  kinect.noise_per_range_squared = 0.002;
  kinect.fresh_fov_rad = 57.0 * kPi / 180.0;
  test::RememberedView view(world, kinect);
  localizer.initialize(way.front(), Eigen::Vector3d(0.01, 0.01, 0.0025).asDiagonal());
  double lost_s = 0.0, worst_m = 0.0;
  for (std::size_t i = 0; i < way.size(); ++i) {
    const LocalizerResult& r = localizer.update(view.scan(way[i], way[i], static_cast<double>(i) / kRate_hz), Pose2(), way[i], 1);
    lost_s += r.verdict == V::kLost ? 1.0 / kRate_hz : 0.0;
    worst_m = std::max(worst_m, distance_m(r.T_map_base, way[i]));
  }
  std::printf("lost for %.1f s, at most %.2f m off\n", lost_s, worst_m);
  EXPECT_EQ(lost_s, 0.0);
  EXPECT_LT(worst_m, 0.3);
  EXPECT_EQ(localizer.result().verdict, V::kOk) << localizer.result().reason;
}

}  // namespace
}  // namespace knav
