// The robot's neighbourhood in scan_360, against the plain definition: the nearest of all returns.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/random.h"
#include "planner_tracker/scan_view.h"

namespace knav {
namespace {

RangeScan scan_of(int rays) {
  RangeScan scan;
  scan.stamp_s = 1.0;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = 2.0 * kPi / rays;
  scan.range_min_m = 0.05;
  scan.range_max_m = 20.0;
  scan.range_m.assign(static_cast<std::size_t>(rays), std::numeric_limits<float>::infinity());
  return scan;
}

TEST(ScanView, ClearancesAreExactWhereTheyDecideWhetherTheRobotFits) {
  const Pose2 T_base_sensor{0.1, -0.02, 0.3}, T_then{1.0, 2.0, 0.5}, T_now{1.15, 2.05, 0.7};
  const Pose2 T_now_sensor = T_now.inverse() * T_then * T_base_sensor;
  int exact = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    RandomStream random(5, random_stream::kTest, seed, 0);
    RangeScan scan = scan_of(720);
    std::vector<Point2> returns;
    for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
      if (random.uniform() < 0.6) continue;
      scan.range_m[i] = static_cast<float>(random.uniform(0.3, 4.0));
      const double angle = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
      returns.push_back(T_now_sensor * Point2{scan.range_m[i] * std::cos(angle), scan.range_m[i] * std::sin(angle)});
    }
    ScanView view(2.0, 0.8);
    view.set(scan, T_base_sensor);
    view.place(T_then, T_now);
    for (int k = 0; k < 200; ++k) {
      const double x = random.uniform(-1.1, 1.1), y = random.uniform(-1.1, 1.1);
      double nearest = 1e9;
      for (const Point2& p : returns) nearest = std::min(nearest, std::hypot(p.x_m - x, p.y_m - y));
      if (nearest < 0.45) {
        EXPECT_NEAR(view.clearance_m(x, y), nearest, 1e-9);
        ++exact;
      } else {
        EXPECT_NEAR(view.clearance_m(x, y), std::min(nearest, 0.8), 0.06);  // a cell's diagonal
      }
    }
  }
  EXPECT_GT(exact, 500);
}

TEST(ScanView, RaysThatEndNowhereAreNoObstacles) {
  RangeScan scan = scan_of(360);
  std::fill(scan.range_m.begin(), scan.range_m.begin() + 180, std::numeric_limits<float>::quiet_NaN());
  ScanView view(2.0, 0.8);
  view.set(scan, {});
  view.place({}, {});
  EXPECT_NEAR(view.clearance_m(0.0, 0.0), 0.8, 0.06);
}

}  // namespace
}  // namespace knav
