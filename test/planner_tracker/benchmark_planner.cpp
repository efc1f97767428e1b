// What the planner's parts cost on a real floor (142 x 54 m at 4.56 cm). planner_benchmark reports quantiles.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "core/distance_transform.h"
#include "core/random.h"
#include "planner_tracker/grid_planner.h"
#include "planner_tracker/planner_tracker.h"

namespace knav {
namespace {

/// Empty where the floor plan is absent.
OccupancyGrid hospital() {
  const char* folder = std::getenv("KINECT_NAV_REALDATA");
  const std::string path = (folder ? std::string(folder) : KINECT_NAV_SOURCE_DIR "/../shared/realdata") +
                           "/maps/stage/hospital.png";
  const cv::Mat image = cv::imread(path, cv::IMREAD_GRAYSCALE);
  OccupancyGrid grid;
  grid.geometry = {image.cols, image.rows, 0.0456, 0.0, 0.0};
  grid.value.resize(grid.geometry.cell_count());
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      grid.value[grid.geometry.index(x, image.rows - 1 - y)] = image.at<std::uint8_t>(y, x) < 128 ? 100 : 0;
    }
  }
  return grid;
}

bool skip(benchmark::State& state, const OccupancyGrid& grid) {
  if (!grid.value.empty()) return false;
  state.SkipWithError("KINECT_NAV_SKIP: hospital.png is not there; set KINECT_NAV_REALDATA");
  return true;
}

void set_up(const PlannerTrackerConfig& config, const OccupancyGrid& grid, CombinedMap* map,
            GridPlanner* planner) {
  map->set_global({}, grid, {});
  planner->set_map(map->global());
  (void)config;
}

void ClearanceOfWholeMap(benchmark::State& state) {
  const OccupancyGrid grid = hospital();
  if (skip(state, grid)) return;
  std::vector<std::uint8_t> blocked;
  for (const auto v : grid.value) blocked.push_back(v > 50);
  const bool core = state.range(0) == 1;
  TruncatedDistance truncated(14);
  std::vector<std::int16_t> squared(grid.value.size());
  for (auto _ : state) {
    if (core)
      benchmark::DoNotOptimize(euclidean_distance_m(grid.geometry, blocked));
    else {
      truncated.update(grid.geometry.width_cells, grid.geometry.height_cells, blocked.data(), 0, nullptr,
                       {0, 0, grid.geometry.width_cells, grid.geometry.height_cells}, squared.data());
      benchmark::DoNotOptimize(squared.data());
    }
  }
}
BENCHMARK(ClearanceOfWholeMap)->ArgName("core")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

void OverlayOf20mLocalMap(benchmark::State& state) {
  const OccupancyGrid grid = hospital();
  if (skip(state, grid)) return;
  PlannerTrackerConfig config;
  CombinedMap map(config.preferred_radius_m() + 0.2, 65, 25);
  map.set_global({}, grid, {});
  OccupancyGrid local;
  local.geometry = {400, 400, 0.05, -10.0, -10.0};
  RandomStream random(1, random_stream::kTest, 0, 0);
  for (int i = 0; i < 160000; ++i)
    local.value.push_back(static_cast<std::int8_t>(random.uniform() < 0.05 ? 100 : 0));
  double x = 40.0;
  for (auto _ : state) map.set_local(local, {x = x < 90.0 ? x + 0.13 : 40.0, 18.0, 0.01 * x});
}
BENCHMARK(OverlayOf20mLocalMap)->Unit(benchmark::kMillisecond);

void PlanAcrossHospital(benchmark::State& state) {
  const OccupancyGrid grid = hospital();
  if (skip(state, grid)) return;
  PlannerTrackerConfig config;
  CombinedMap map(config.preferred_radius_m() + 0.2, 65, 25);
  GridPlanner planner(config);
  set_up(config, grid, &map, &planner);
  const Point2 start{16.0, 13.3}, goal{16.0 + static_cast<double>(state.range(0)), 13.3};
  Point2 from, to;
  planner.nearest_open(map.global(), start, 2.0, &from);
  planner.nearest_open(map.global(), goal, 2.0, &to);
  PlanResult result;
  for (auto _ : state) planner.plan(map.combined(), from, to, &result);
  state.counters["length_m"] = result.length_m;
  state.counters["expanded"] = result.expanded;
}
BENCHMARK(PlanAcrossHospital)->ArgName("m")->Arg(10)->Arg(30)->Arg(70)->Unit(benchmark::kMillisecond);

void ControlStep(benchmark::State& state) {
  const OccupancyGrid grid = hospital();
  if (skip(state, grid)) return;
  PlannerTracker planner{PlannerTrackerConfig{}};
  planner.set_map({}, grid, {});
  RangeScan scan;
  scan.range_max_m = 20.0;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = 2.0 * kPi / 3600;
  scan.range_m.assign(3600, 1.2f);
  double now_s = 10.0;
  planner.set_goal({60.0, 13.3, 0.0});
  for (auto _ : state) {
    now_s += 0.05;
    scan.stamp_s = now_s;
    planner.set_scan(scan, Pose2{});
    RobotState robot;
    robot.has_pose = true;
    robot.T_map_base = {16.0, 13.3, 0.0};
    robot.pose_stamp_s = robot.odom_stamp_s = now_s;
    const Command command = planner.step(now_s, robot);
    if (command.finished) planner.set_goal({60.0, 13.3, 0.0});
  }
}
BENCHMARK(ControlStep)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace knav
