// Analytic worlds as truth for the ray caster: rooms, thin walls, corridors at sharp angles, gaps in
// knowledge.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "core/contour.h"
#include "core/fast_math.h"
#include "core/random.h"

namespace knav {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

struct Segment {
  double ax, ay, bx, by;
};

/// Distance from (x, y) along (dx, dy) to the nearest segment; infinity if none is met.
double true_range(const std::vector<Segment>& world, double x, double y, double dx, double dy) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Segment& s : world) {
    const double ex = s.bx - s.ax, ey = s.by - s.ay, determinant = dx * ey - dy * ex;
    if (std::fabs(determinant) < 1e-12) continue;
    const double t = ((s.ax - x) * ey - (s.ay - y) * ex) / determinant;
    const double u = ((s.ax - x) * dy - (s.ay - y) * dx) / determinant;
    if (t > 1e-6 && u >= 0.0 && u <= 1.0) nearest = std::min(nearest, t);
  }
  return nearest;
}

class ContourTest : public ::testing::Test {
 protected:
  ContourTest() : grid_(config_, 12.0) { contour_.range_max_m = 10.0; }

  /// A perfect scan of 360 degrees, or of `fov_rad` round the heading.
  void look(const std::vector<Segment>& world, const Pose2& pose, double fov_rad = 2 * kPi) {
    RangeScan scan;
    const int n = 1440;
    scan.angle_increment_rad = fov_rad / n;
    scan.angle_min_rad = -fov_rad / 2;
    scan.range_max_m = 30.0;
    for (int i = 0; i < n; ++i) {
      const double a = pose.yaw_rad + scan.angle_min_rad + i * scan.angle_increment_rad;
      scan.range_m.push_back(
          static_cast<float>(true_range(world, pose.x_m, pose.y_m, std::cos(a), std::sin(a))));
    }
    ObservationLimits limits;
    limits.truncation = config_.truncation;
    observation_from(scan, limits, &newest_);
    newest_.sequence = ++sequence_;
    newest_.age_clock_s = clock_s_;
    newest_.T_map_sensor = pose;
    grid_.add(newest_);
  }

  TsdfConfig config_;
  TsdfGrid grid_;
  ContourConfig contour_;
  TsdfObservation newest_;
  std::uint32_t sequence_ = 0;
  float clock_s_ = 0.0f;
};

const std::vector<Segment> kRoom = {{-3, -2, 4, -2}, {4, -2, 4, 3}, {4, 3, -3, 3}, {-3, 3, -3, -2}};

TEST_F(ContourTest, ARoomToAFractionOfACell) {
  look(kRoom, {0.3, 0.2, 0.0});
  const Pose2 from{0.3, 0.2, 0.7};
  RangeScan scan;
  extract_contour(grid_, contour_, from, 0.0f, &scan);
  ASSERT_EQ(scan.range_m.size(), 3600u);
  double square = 0.0, worst = 0.0;
  for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
    const double a = from.yaw_rad - kPi + static_cast<double>(i) * 2 * kPi / 3600;
    const double truth = true_range(kRoom, from.x_m, from.y_m, std::cos(a), std::sin(a));
    ASSERT_TRUE(std::isfinite(scan.range_m[i])) << i;
    const double error = scan.range_m[i] - truth;
    square += error * error;
    worst = std::max(worst, std::fabs(error));
    EXPECT_FLOAT_EQ(scan.evidence[i], 1.0f);
  }
  EXPECT_LT(std::sqrt(square / 3600), 0.006);
  EXPECT_LT(worst, 0.05);
}

TEST_F(ContourTest, ACorridorSeenAtSharpAnglesHasNoHoles) {
  // Driven along with the narrow view, the walls' support is thin (the paper's reason for visiting every
  // cell).
  const std::vector<Segment> corridor = {{-30, -1, 30, -1}, {-30, 1, 30, 1}};
  for (double x = -8.0; x <= 0.0; x += 0.1) look(corridor, {x, 0.0, 0.0}, 1.0);
  const Pose2 from{-3.0, 0.2, 0.0};
  RangeScan scan;
  contour_.range_max_m = 4.0;
  extract_contour(grid_, contour_, from, 0.0f, &scan);
  for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
    const double a = -kPi + static_cast<double>(i) * 2 * kPi / 3600;
    const double truth = true_range(corridor, from.x_m, from.y_m, std::cos(a), std::sin(a));
    if (truth > 3.5 || from.x_m + truth * std::cos(a) < -5.5)
      continue;  // farther back the wall was out of view
    ASSERT_TRUE(std::isfinite(scan.range_m[i])) << "ray at " << a;
    EXPECT_NEAR(scan.range_m[i] * std::fabs(std::sin(a)), truth * std::fabs(std::sin(a)), 0.03)
        << "ray at " << a;
  }
}

TEST_F(ContourTest, AThinWallStopsEveryRay) {
  // 6 cm thick, seen from both sides, as a board is.
  std::vector<Segment> world = kRoom;
  world.push_back({1.50, -2, 1.50, 2});
  world.push_back({1.56, -2, 1.56, 2});
  for (int k = 0; k < 5; ++k) {
    look(world, {0.0, 0.1 * k, 0.0});
    look(world, {3.0, 0.1 * k, 0.0});
  }
  for (const double x : {0.0, 3.0}) {
    RangeScan scan;
    extract_contour(grid_, contour_, {x, 0.3, 0.0}, 0.0f, &scan);
    for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
      const double a = -kPi + static_cast<double>(i) * 2 * kPi / 3600;
      const double truth = true_range(world, x, 0.3, std::cos(a), std::sin(a));
      const double at_y = 0.3 + truth * std::sin(a), at_x = x + truth * std::cos(a);
      if (std::fabs(at_x - 1.53) > 0.05 || std::fabs(at_y) > 1.2) continue;
      ASSERT_NEAR(scan.range_m[i], truth, 0.12) << "from x = " << x << ", ray at " << a;
    }
  }
}

TEST_F(ContourTest, UnknownIsNeverFree) {
  // Looking ahead only: behind and beside is unknown, beyond the wall too.
  look(kRoom, {0.0, 0.0, 0.0}, 1.0);
  RangeScan scan;
  extract_contour(grid_, contour_, {0.0, 0.0, 0.0}, 0.0f, &scan);
  EXPECT_NEAR(scan.range_m[1800], 4.0, 0.02);  // ahead
  EXPECT_TRUE(std::isnan(scan.range_m[0]));    // behind
  EXPECT_TRUE(std::isnan(scan.range_m[900]));  // right
  EXPECT_EQ(scan.evidence[0], 0.0f);
  for (const float range : scan.range_m) EXPECT_FALSE(std::isinf(range));
}

TEST_F(ContourTest, FreeToTheEndIsInfinite) {
  look({{9, -9, 9, 9}}, {0.0, 0.0, 0.0}, 1.0);
  contour_.range_max_m = 6.0;
  RangeScan scan;
  extract_contour(grid_, contour_, {0.0, 0.0, 0.0}, 0.0f, &scan);
  EXPECT_TRUE(std::isinf(scan.range_m[1800]));
  EXPECT_TRUE(std::isnan(scan.range_m[0]));
}

TEST_F(ContourTest, PositiveNextToUnknownIsNoSurface) {
  // Seen free up to 3 m, then nothing: the ray is unknown, not a wall at 3 m.
  RangeScan scan;
  scan.angle_min_rad = -0.5;
  scan.angle_increment_rad = 0.01;
  scan.range_max_m = 30.0;
  scan.range_m.assign(101, std::numeric_limits<float>::infinity());
  ObservationLimits limits;
  limits.scan_free_beyond_m = 3.0;
  TsdfObservation o;
  observation_from(scan, limits, &o);
  o.sequence = 1;
  grid_.add(o);
  RangeScan contour;
  extract_contour(grid_, contour_, {0.0, 0.0, 0.0}, 0.0f, &contour);
  EXPECT_TRUE(std::isnan(contour.range_m[1800]));
}

TEST_F(ContourTest, EvidenceFallsWithAge) {
  look(kRoom, {0.0, 0.0, 0.0});
  clock_s_ = 30.0f;
  look(kRoom, {0.0, 0.0, 0.0}, 1.0);
  contour_.evidence_decay_s = 30.0;
  RangeScan scan;
  extract_contour(grid_, contour_, {0.0, 0.0, 0.0}, 30.0f, &scan);
  EXPECT_NEAR(scan.evidence[1800], 1.0, 1e-5);
  EXPECT_NEAR(scan.evidence[0], std::exp(-1.0), 1e-5);
}

TEST_F(ContourTest, NewestProfileReplacesItsSection) {
  // The map knows the room; then a box stands 1 m before the camera, which sits 0.2 m ahead of the robot's
  // origin.
  look(kRoom, {0.0, 0.0, 0.0});
  DepthProfile profile;
  profile.fx_px = 585;
  profile.cx_px = 319.5;
  profile.z_m.assign(640, kNaN);
  for (std::size_t u = 220; u < 420; ++u) profile.z_m[u] = 1.0f;
  profile.free_from_m.assign(640, kNaN);
  profile.free_to_m.assign(640, kNaN);
  profile.height_class.assign(640, HeightClass::kMiddle);
  TsdfObservation o;
  observation_from(profile, ObservationLimits{}, &o);
  const Pose2 T_map_robot{0.1, 0.0, 0.0};
  o.T_map_sensor = T_map_robot * Pose2{0.2, 0.0, 0.0};
  RangeScan scan;
  extract_contour(grid_, contour_, T_map_robot, 5.0f, &scan);
  const RangeScan before = scan;
  merge_newest(o, T_map_robot, &scan);
  const double edge_rad = std::atan2(99.5 / 585, 1.2);  // the box spans +-0.17 m at 1.2 m
  for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
    const double a = -kPi + static_cast<double>(i) * 2 * kPi / 3600;
    if (std::fabs(a) < edge_rad - 0.004) {
      EXPECT_NEAR(scan.range_m[i], 1.2 / std::cos(a), 1e-3) << a;
      EXPECT_EQ(scan.evidence[i], 1.0f);
    } else if (std::fabs(a) > edge_rad + 0.004) {
      EXPECT_EQ(scan.range_m[i], before.range_m[i]) << a;
      EXPECT_EQ(scan.evidence[i], before.evidence[i]) << a;
    }
  }
}

TEST_F(ContourTest, ALowThingWhoseFrontHasLeftTheViewDoesNotComeNoFarther) {
  // The map's room, and a low thing before which no floor is seen: across what the map has 3 m ahead, and in a gap of it.
  look(kRoom, {0.0, 0.0, 0.0});
  DepthProfile profile;
  profile.fx_px = 585;
  profile.cx_px = 319.5;
  profile.z_m.assign(640, 20.0f);
  profile.free_from_m.assign(640, kNaN);
  profile.free_to_m.assign(640, kNaN);
  profile.height_class.assign(640, HeightClass::kLow);
  RangeScan scan;
  extract_contour(grid_, contour_, {}, 5.0f, &scan);
  const RangeScan before = scan;
  const auto merge = [&](float z_m) {
    std::fill(profile.z_m.begin(), profile.z_m.end(), z_m);
    TsdfObservation o;
    observation_from(profile, ObservationLimits{}, &o);
    o.T_map_sensor = {};
    scan = before;
    merge_newest(o, {}, &scan);
  };
  const std::size_t ahead = 1800;
  ASSERT_TRUE(std::isfinite(before.range_m[ahead]));
  merge(before.range_m[ahead] + 0.15f);
  EXPECT_EQ(scan.range_m[ahead], before.range_m[ahead]);
  merge(before.range_m[ahead] - 0.15f);
  EXPECT_NEAR(scan.range_m[ahead], before.range_m[ahead] - 0.15f, 1e-3);
}

TEST(Contour, CrossingFreeBlocksAtOnceFindsWhatSingleStepsFind) {
  // A cluttered map, looked at from many places, half of them with the window scrolled so that the torus' seam lies in
  // view: every ray as cast_ray() finds it cell by cell.
  TsdfConfig config;
  TsdfGrid grid(config, 12.0);
  RandomStream random(5, random_stream::kTest, 9, 0);
  std::uint32_t sequence = 0;
  int surfaces = 0, free = 0, unknown = 0;
  for (int place = 0; place < 12; ++place) {
    const Pose2 robot{0.9 * place, -0.5 * place, random.uniform(-kPi, kPi)};
    grid.scroll_to(robot.x_m, robot.y_m, sequence + 1);
    for (int k = 0; k < 3; ++k) {
      RangeScan scan;
      scan.angle_min_rad = random.uniform(-kPi, 0.0);
      scan.angle_increment_rad = 0.01;
      scan.range_max_m = 30.0;
      for (int i = 0; i < 200; ++i) {
        const bool hole = random.uniform() < 0.02;
        scan.range_m.push_back(hole ? std::numeric_limits<float>::quiet_NaN()
                                    : static_cast<float>(5.0 + 3.0 * std::sin(0.05 * i) + random.uniform(-0.05, 0.05)));
      }
      TsdfObservation o;
      observation_from(scan, ObservationLimits{}, &o);
      o.sequence = ++sequence;
      o.age_clock_s = static_cast<float>(sequence);
      o.T_map_sensor = robot;
      grid.add(o);
    }
    ContourConfig contour;
    contour.rays = 720;
    contour.range_max_m = place % 2 == 0 ? 4.0 : 11.0;
    RangeScan scan;
    const float now_s = static_cast<float>(sequence) + 1.0f;
    extract_contour(grid, contour, robot, now_s, &scan);
    for (std::size_t i = 0; i < 720; ++i) {
      const double angle = robot.yaw_rad + scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
      double cosine, sine;
      cos_sin(&angle, 1, &cosine, &sine);
      const RayEnd end = cast_ray(grid, contour, robot.x_m, robot.y_m, cosine, sine, contour.range_max_m);
      const bool known = end.kind != RayEnd::Kind::kUnknown;
      ASSERT_EQ(scan.evidence[i], known ? std::exp(-(now_s - end.last_seen_s) / static_cast<float>(contour.evidence_decay_s)) : 0.0f);
      if (end.kind == RayEnd::Kind::kSurface) {
        ++surfaces;
        ASSERT_EQ(scan.range_m[i], end.range_m);
      } else if (end.kind == RayEnd::Kind::kFree) {
        ++free;
        ASSERT_TRUE(std::isinf(scan.range_m[i]));
      } else {
        ++unknown;
        ASSERT_TRUE(std::isnan(scan.range_m[i]));
      }
    }
  }
  EXPECT_GT(surfaces, 500);
  EXPECT_GT(free, 500);
  EXPECT_GT(unknown, 500);
}

}  // namespace
}  // namespace knav
