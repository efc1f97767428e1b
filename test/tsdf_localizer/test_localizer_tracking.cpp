#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/error.h"
#include "synthetic_building.h"
#include "tsdf_localizer/localizer.h"

namespace knav {
namespace {

using test::Building;
using test::ScanModel;
using V = LocalizationVerdict;

constexpr double kRate_hz = 8.0;
const std::vector<Point2> kTour = {{3.5, 3.0},  {3.5, 8.0},  {10.5, 8.0}, {10.5, 4.5},  {12.5, 3.8},
                                   {10.5, 5.0}, {10.5, 8.0}, {19.5, 8.0}, {19.5, 5.0},  {21.0, 2.5},
                                   {19.5, 6.0}, {19.5, 8.0}, {17.5, 8.0}, {17.5, 10.5}, {20.0, 11.0}};

/// What scan_360 looks like: 57 deg fresh and as noisy as a Kinect, the rest from the local map, with holes.
ScanModel kinect() {
  ScanModel model;
  model.rays = 720;
  model.noise_m = 0.01;
  model.noise_per_range_squared = 0.002;
  model.fresh_fov_rad = 57.0 * kPi / 180.0;
  model.unknown_fraction = 0.2;
  return model;
}

struct Figures {
  double mean_m = 0.0, worst_m = 0.0, worst_rad = 0.0, ok_fraction = 0.0;
  int ok_while_wrong = 0, lost = 0;
};

/// Drives a localizer that was told where it starts.
Figures follow(const Building& world, const DistanceMap& map, const ScanModel& model,
               const std::vector<Pose2>& truth, const std::vector<Pose2>& odometry,
               std::vector<LocalizerResult>* log = nullptr) {
  Localizer localizer{LocalizerConfig()};
  localizer.set_map(map);
  const Pose2 start = truth.front() * Pose2{0.1, -0.1, 0.05};
  localizer.initialize(start, Eigen::Vector3d(0.04, 0.04, 0.01).asDiagonal());
  test::RememberedView view(world, model);
  Figures f;
  int counted = 0, ok = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double t = static_cast<double>(i) / kRate_hz;
    const LocalizerResult& r =
        localizer.update(view.scan(truth[i], odometry[i], t), Pose2(), odometry[i], 1);
    if (log) log->push_back(r);
    if (t < 2.0) continue;
    const double error = distance_m(r.T_map_base, truth[i]);
    f.mean_m += error;
    f.worst_m = std::max(f.worst_m, error);
    f.worst_rad =
        std::max(f.worst_rad, std::fabs(normalize_angle_rad(r.T_map_base.yaw_rad - truth[i].yaw_rad)));
    ok += r.verdict == V::kOk;
    f.ok_while_wrong += r.verdict == V::kOk && error > 0.5;
    f.lost += r.verdict == V::kLost;
    ++counted;
    EXPECT_TRUE(r.covariance.allFinite());
  }
  f.mean_m /= counted;
  f.ok_fraction = static_cast<double>(ok) / counted;
  std::printf("mean %.3f m, worst %.3f m, %.2f deg, ok %.3f, lost %d\n", f.mean_m, f.worst_m,
              f.worst_rad * 180.0 / kPi, f.ok_fraction, f.lost);
  return f;
}

/// Twice what the local mapper drifts (docs/local_mapper.md).
TEST(LocalizerTracking, FollowsALocalMapThatDriftsByOnePercent) {
  const Building office = test::office();
  const auto truth = test::drive(kTour, kRate_hz);
  const Figures f =
      follow(office, office.distance_map(), kinect(), truth, test::odometry_of(truth, 1.01, 0.99));
  EXPECT_LT(f.mean_m, 0.04);
  EXPECT_LT(f.worst_m, 0.20);
  EXPECT_LT(f.worst_rad, 3.0 * kPi / 180.0);
  EXPECT_GT(f.ok_fraction, 0.98);
}

TEST(LocalizerTracking, FollowsWithAPerfectLaserAndThreePercentMotionError) {
  const Building office = test::office();
  const auto truth = test::drive(kTour, kRate_hz);
  ScanModel laser;
  laser.rays = 720;
  const Figures f = follow(office, office.distance_map(), laser, truth, test::odometry_of(truth, 1.03, 0.97));
  EXPECT_LT(f.mean_m, 0.03);
  EXPECT_LT(f.worst_m, 0.15);
  EXPECT_GT(f.ok_fraction, 0.98);
}

TEST(LocalizerTracking, SurvivesMovedFurnitureAndACrowd) {
  Building changed = test::office();
  for (std::size_t i = 16; i < changed.blocks.size(); i += 3) {  // a third of the furniture
    changed.blocks[i].x0_m += 0.7;
    changed.blocks[i].x1_m += 0.7;
  }
  const auto truth = test::drive(kTour, kRate_hz);
  // people stand along the way, closer than 2 m at times
  for (const Point2 p :
       {Point2{4.6, 8.6}, Point2{7.0, 7.3}, Point2{9.5, 8.7}, Point2{12.0, 7.3}, Point2{15.0, 8.6},
        Point2{18.5, 7.4}, Point2{20.5, 8.5}, Point2{20.6, 4.5}, Point2{18.4, 5.5}, Point2{11.5, 5.6}}) {
    changed.wall(p.x_m - 0.15, p.y_m - 0.15, p.x_m + 0.15, p.y_m + 0.15);
  }
  const Figures f =
      follow(changed, test::office().distance_map(), kinect(), truth, test::odometry_of(truth, 1.03, 0.97));
  EXPECT_LT(f.mean_m, 0.08);
  EXPECT_LT(f.worst_m, 0.30);
  EXPECT_EQ(f.lost, 0);
  EXPECT_GT(f.ok_fraction, 0.9);
}

TEST(LocalizerTracking, GivesTheSameBytesForTheSameSeed) {
  const Building office = test::office();
  auto truth = test::drive(kTour, kRate_hz);
  truth.resize(150);
  const auto odometry = test::odometry_of(truth, 1.03, 0.97);
  std::vector<LocalizerResult> first, second;
  follow(office, office.distance_map(), kinect(), truth, odometry, &first);
  follow(office, office.distance_map(), kinect(), truth, odometry, &second);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].T_map_base.x_m, second[i].T_map_base.x_m);
    EXPECT_EQ(first[i].T_map_base.yaw_rad, second[i].T_map_base.yaw_rad);
    EXPECT_EQ(first[i].covariance, second[i].covariance);
    EXPECT_EQ(first[i].reason, second[i].reason);
  }
}

TEST(LocalizerTracking, GoesOnBlindAndSaysSoInTime) {
  const Building office = test::office();
  Localizer localizer{LocalizerConfig()};
  localizer.set_map(office.distance_map());
  auto truth = test::drive({{1.0, 8.0}, {23.0, 8.0}}, kRate_hz);
  localizer.initialize(truth[0], Eigen::Vector3d(0.01, 0.01, 0.003).asDiagonal());
  RangeScan blind = make_scan(office, truth[0], ScanModel(), 0.0);
  std::fill(blind.range_m.begin(), blind.range_m.end(), std::numeric_limits<float>::quiet_NaN());
  localizer.update(make_scan(office, truth[0], ScanModel(), 0.0), Pose2(), truth[0], 1);
  localizer.update(make_scan(office, truth[1], ScanModel(), 1.0 / kRate_hz), Pose2(), truth[1], 1);
  EXPECT_EQ(localizer.result().verdict, V::kOk) << localizer.result().reason;
  for (std::size_t i = 2; i < truth.size(); ++i) {
    blind.stamp_s = static_cast<double>(i) / kRate_hz;
    localizer.update(blind, Pose2(), truth[i], 1);
  }
  EXPECT_TRUE(localizer.result().accepted);
  EXPECT_LT(distance_m(localizer.result().T_map_base, truth.back()), 0.5);
  EXPECT_EQ(localizer.result().verdict, V::kUncertain);
  EXPECT_EQ(localizer.result().explained_rays, 0u);
}

TEST(LocalizerTracking, AGivenPoseHoldsThoughTheMapperBeginsAnewALittleLater) {
  const Building office = test::office();
  Localizer localizer{LocalizerConfig()};
  localizer.set_map(office.distance_map());
  const Pose2 before{3.5, 5.0, 1.0}, carried_to{10.5, 8.0, 0.0};
  localizer.initialize(before, Eigen::Vector3d(0.01, 0.01, 0.003).asDiagonal());
  double t = 0.0;
  const auto look = [&](const Pose2& at, std::uint32_t epoch) {
    t += 1.0 / kRate_hz;
    localizer.update(make_scan(office, at, ScanModel(), t), Pose2(), Pose2(), epoch);
  };
  for (int i = 0; i < 30; ++i) look(before, 1);
  ASSERT_EQ(localizer.result().verdict, V::kOk);
  localizer.initialize(carried_to, Eigen::Vector3d(0.01, 0.01, 0.003).asDiagonal());
  for (int i = 0; i < 2; ++i) look(before, 1);  // were on their way
  look(carried_to, 2);
  const double given_sd_m = localizer.result().position_sd_m;
  for (int i = 0; i < 10; ++i) look(carried_to, 2);
  EXPECT_LT(distance_m(localizer.result().T_map_base, carried_to), 0.1);
  EXPECT_EQ(localizer.result().verdict, V::kOk) << localizer.result().reason;
  look(carried_to, 3);
  EXPECT_GT(localizer.result().position_sd_m, 1.5 * given_sd_m) << "a new epoch widens, but not the pose's own";
}

TEST(LocalizerInput, SaysWhatIsMissingOrWrongAndKeepsItsState) {
  Localizer localizer{LocalizerConfig()};
  const Building office = test::office();
  const Pose2 pose{3.5, 5.0, 1.0};
  const RangeScan scan = make_scan(office, pose, ScanModel(), 1.0);
  EXPECT_FALSE(localizer.update(scan, Pose2(), Pose2(), 1).accepted);
  EXPECT_EQ(localizer.result().verdict, V::kInitializing);
  EXPECT_NE(localizer.result().reason.find("no map"), std::string::npos);

  localizer.set_map(office.distance_map());
  localizer.initialize(pose, Eigen::Vector3d(0.01, 0.01, 0.003).asDiagonal());
  EXPECT_TRUE(localizer.update(scan, Pose2(), Pose2(), 1).accepted);
  const Pose2 before = localizer.result().T_map_base;
  EXPECT_FALSE(localizer.update(RangeScan(), Pose2(), Pose2(), 1).accepted);
  EXPECT_FALSE(localizer.update(scan, Pose2(), Pose2{NAN, 0, 0}, 1).accepted);
  EXPECT_FALSE(localizer.update(make_scan(office, pose, ScanModel(), 0.5), Pose2(), Pose2(), 1).accepted);
  RangeScan no_angles = scan;
  no_angles.angle_increment_rad = NAN;
  EXPECT_FALSE(localizer.update(no_angles, Pose2(), Pose2(), 1).accepted);
  EXPECT_EQ(localizer.result().T_map_base.x_m, before.x_m);
  EXPECT_THROW(localizer.initialize({NAN, 0, 0}, Eigen::Matrix3d::Identity()), UserError);
  EXPECT_THROW(localizer.initialize(pose, Eigen::Matrix3d::Constant(NAN)), UserError);
  EXPECT_TRUE(localizer.update(make_scan(office, pose, ScanModel(), 2.0), Pose2(), Pose2(), 1).accepted);
  EXPECT_LT(distance_m(localizer.result().T_map_base, pose), 0.2);
  DistanceMap broken = office.distance_map();
  broken.distance_m.pop_back();
  EXPECT_THROW(localizer.set_map(broken), UserError);
}

}  // namespace
}  // namespace knav
