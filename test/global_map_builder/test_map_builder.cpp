#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "flat_drive.h"

namespace knav {
namespace {

using namespace flat_world;

MapBuilderConfig only(bool automatic, bool buttons) {
  MapBuilderConfig config;
  config.closures.automatic = automatic;
  config.closures.buttons = buttons;
  config.closures.min_path_m = 8.0;
  return config;
}

double final_error_m(const Route& drive, const BuiltMap& built) {
  const Pose2 T_start_end = drive.truth.front().inverse() * drive.truth.back();
  return distance_m(built.map.trajectory.back().T_map_robot, T_start_end);
}

/// Root mean square distance of the contour to the true walls; the start pose is the origin of both.
double contour_rmse_m(const Route& drive, const Contour& contour) {
  double squares = 0.0;
  const std::vector<Point2> points = sample_contour(contour, 0.05);
  for (const Point2& p : points) squares += std::pow(distance_to_walls(drive.walls, p.x_m, p.y_m), 2);
  return std::sqrt(squares / static_cast<double>(points.size()));
}

/// The share of the walls in view that have contour within 10 cm: the long sides and one end of the block in
/// the middle, but for what the camera's 57 degrees never saw.
double completeness(const Contour& contour) {
  const std::vector<Point2> points = sample_contour(contour, 0.05);
  double found = 0.0, all = 0.0;
  const auto look = [&](double x, double y) {
    all += 1.0;
    found += std::any_of(points.begin(), points.end(),
                         [&](const Point2& p) { return std::hypot(p.x_m - x, p.y_m - y) < 0.1; });
  };
  for (double x = 3.0; x < 6.8; x += 0.1) look(x, 1.5);
  for (double x = 0.0; x < 2.9; x += 0.1) look(x, -1.5);
  for (double y = 3.2; y < 5.2; y += 0.1) look(9.5, y);
  for (double y = 3.8; y < 8.0; y += 0.1) look(12.5, y);
  return found / all;
}

double wheel_error_m(const Route& drive) {
  return distance_m(drive.odometry.front().inverse() * drive.odometry.back(),
                    drive.truth.front().inverse() * drive.truth.back());
}

TEST(MapBuilder, ClosesALoopOfDriftingOdometryByItself) {
  const Route drive = once_round_and_a_bit();
  ASSERT_GT(wheel_error_m(drive), 2.0);
  MapBuilder builder(only(true, false), small_mapper());
  feed(drive, {}, &builder);
  const BuiltMap built = builder.build();
  const auto accepted = std::count_if(built.record.closures.begin(), built.record.closures.end(),
                                      [](const Closure& c) { return c.accepted; });
  EXPECT_GE(accepted, 1);
  EXPECT_LT(final_error_m(drive, built), 0.15);
  EXPECT_LT(contour_rmse_m(drive, built.contour), 0.06);
  EXPECT_GT(completeness(built.contour), 0.9);
  EXPECT_EQ(built.map.trajectory.size(), drive.truth.size());
  EXPECT_NEAR(distance_m(built.map.trajectory.front().T_map_robot, Pose2{}), 0.0, 1e-9)
      << "the start is the origin";

  // Values of the grids, at places known to be open, a wall and never seen.
  const GridGeometry& g = built.map.occupancy.geometry;
  const auto occupancy = [&](double x, double y) {
    return built.map.occupancy.value[g.index(g.cell_x(x), g.cell_y(y))];
  };
  EXPECT_EQ(occupancy(5.0, 0.2), 0);
  EXPECT_EQ(occupancy(5.5, 3.5), -1) << "inside the block nothing was seen; unknown is not free";
  EXPECT_TRUE(std::isnan(built.map.distance.nearest(5.5, 3.5)));
  EXPECT_NEAR(built.map.distance.nearest(5.525, 0.025), 1.475, 0.06);
  for (std::size_t i = 0; i < g.cell_count(); ++i) {
    if (built.map.occupancy.value[i] == 0) {
      ASSERT_GT(built.map.distance.distance_m[i], 0.0f);
    }
  }
}

TEST(MapBuilder, ClosesALoopByTheButtonAlone) {
  const Route drive = once_round_and_a_bit();
  // The robot stands at (0, 0) at first and again after the round: where the truth comes nearest to it late.
  std::size_t back = drive.truth.size() / 2;
  for (std::size_t i = back; i < drive.truth.size(); ++i) {
    if (distance_m(drive.truth[i], {}) < distance_m(drive.truth[back], {})) back = i;
  }
  MapBuilder builder(only(false, true), small_mapper());
  feed(drive, {0, back}, &builder);
  const BuiltMap built = builder.build();
  ASSERT_EQ(built.record.closures.size(), 1u);
  EXPECT_EQ(built.record.closures[0].source, "button");
  EXPECT_TRUE(built.record.closures[0].accepted);
  EXPECT_LT(final_error_m(drive, built), 0.15);
}

TEST(MapBuilder, TheSameDriveGivesTheSameMap) {
  Route drive;
  drive.truth = drive_through({{0, 0}, {4, 0}});
  drive.odometry = drifting_odometry(drive.truth);
  std::string checksum[2];
  for (std::string& sum : checksum) {
    MapBuilder builder(only(true, true), small_mapper());
    feed(drive, {}, &builder);
    const BuiltMap built = builder.build();
    sum = map_checksum(built.map.occupancy, built.map.distance);
  }
  EXPECT_EQ(checksum[0], checksum[1]);
}

TEST(MapBuilder, GroundThatTheRobotStoodOnUnseenIsFreeAsWideAsItsBodyAndTheMargin) {
  Route drive;
  drive.truth = drive_through({{0, 0}, {3, 0}});
  drive.odometry = drive.truth;
  // Behind the start, where the camera never looked and nothing is known: how far off the last free cell's middle is.
  const auto free_behind_start_m = [&](double margin_m) {
    MapBuilderConfig config = only(true, true);
    config.robot_radius_m = 0.2;
    config.driven_margin_m = margin_m;
    MapBuilder builder(config, small_mapper());
    feed(drive, {}, &builder);
    const BuiltMap built = builder.build();
    const GridGeometry& g = built.map.occupancy.geometry;
    const int iy = g.cell_y(0.0);
    double free_m = 0.0;
    for (int ix = g.cell_x(-0.01); g.contains(ix, iy) && built.map.occupancy.value[g.index(ix, iy)] == 0; --ix) free_m = -g.center_x_m(ix);
    return free_m;
  };
  const double cell_m = 0.05;
  EXPECT_NEAR(free_behind_start_m(0.0), 0.2, cell_m);
  EXPECT_NEAR(free_behind_start_m(0.1), 0.3, cell_m);
}

TEST(MapBuilder, SaysWhenThereIsNothingToMap) {
  MapBuilder empty({}, small_mapper());
  EXPECT_THROW(empty.build(), UserError);

  MapBuilder blind({}, small_mapper());
  DepthProfile nothing;
  nothing.fx_px = 100.0;
  nothing.cx_px = 50.0;
  nothing.z_m.assign(100, std::numeric_limits<float>::quiet_NaN());
  nothing.free_from_m = nothing.free_to_m = nothing.z_m;
  nothing.height_class.assign(100, HeightClass::kNone);
  for (int i = 0; i < 20; ++i) {
    nothing.stamp_s = kStart_s + 0.1 * i;
    blind.add_odometry(nothing.stamp_s, {});
    blind.add(nothing, {});
  }
  EXPECT_THROW(blind.build(), UserError);
}

Submap submap_at(const std::vector<Wall>& walls, const Pose2& T_world_keyframe) {
  SurfaceConfig surface;
  surface.range_max_m = 8.0;
  surface.min_looks = 1;
  std::vector<TsdfObservation> observations;
  for (int i = 0; i < 24; ++i) {
    const Pose2 T_keyframe_camera{0.05 * i, 0.0, i * kPi / 12.0};
    RandomStream random(11, random_stream::kTest, static_cast<std::uint64_t>(i), 1);
    observation_from(profile_at(walls, T_world_keyframe * T_keyframe_camera, 1.0, random), surface.limits(),
                     &observations.emplace_back());
    observations.back().T_map_sensor = T_keyframe_camera;
  }
  return Submap(surface, observations);
}

TEST(SubmapMatcher, FindsTheTransformFromAPoorGuess) {
  const std::vector<Wall> walls = ring();
  const Pose2 from{3.0, 0.2, 0.3}, to{4.5, -0.3, 2.6};
  const Pose2 truth = from.inverse() * to;
  const MatchResult match = match_submaps({}, submap_at(walls, from), submap_at(walls, to),
                                          truth * Pose2{1.1, -0.9, 0.25}, {2.5, 0.5});
  EXPECT_TRUE(match.accepted) << match.reason;
  EXPECT_LT(distance_m(match.T_from_to, truth), 0.04);
  EXPECT_LT(std::fabs(normalize_angle_rad(match.T_from_to.yaw_rad - truth.yaw_rad)), 0.02);
}

TEST(SubmapMatcher, RefusesTwoDifferentPlaces) {
  const std::vector<Wall> walls = ring();
  const MatchResult match = match_submaps({}, submap_at(walls, {0.0, 0.0, 0.0}),
                                          submap_at(walls, {11.0, 3.5, 0.0}), {0.3, 0.2, 0.0}, {2.5, 0.5});
  EXPECT_FALSE(match.accepted);
  EXPECT_FALSE(match.reason.empty());
}

TEST(SubmapMatcher, AnOpenCorridorLeavesItsDirectionOpen) {
  std::vector<Wall> walls;
  add_box(-50.0, -1.0, 50.0, 1.0, &walls);
  const MatchResult match = match_submaps({}, submap_at(walls, {0.0, 0.0, 0.0}),
                                          submap_at(walls, {0.6, 0.0, 0.0}), {0.5, 0.1, 0.02}, {1.5, 0.2});
  EXPECT_GT(match.information(1, 1), 30.0 * match.information(0, 0)) << "across is known, along is not";
  EXPECT_NEAR(match.T_from_to.y_m, 0.0, 0.03);
}

}  // namespace
}  // namespace knav
