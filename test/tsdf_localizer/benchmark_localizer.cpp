// The budget of a scan: 2,000 particles x 3,600 rays in 6 ms on one core (docs/localization.md).
#include <benchmark/benchmark.h>

#include <cmath>

#include "core/occupancy_distance.h"
#include "synthetic_building.h"
#include "tsdf_localizer/belief.h"
#include "tsdf_localizer/global_search.h"
#include "tsdf_localizer/localizer.h"
#include "tsdf_localizer/pose_check.h"
#include "tsdf_localizer/saved_pose.h"

namespace knav {
namespace {

const Pose2 kPose{10.5, 5.0, 2.0};

void mean_prices_of(benchmark::State& state, PriceCode code) {
  if (!has(code)) return state.SkipWithError("this processor cannot");
  const test::Building office = test::office();
  const MapFields fields = make_map_fields(office.distance_map(), {}, {});
  LocalizerConfig config;
  config.laser_max_beams = static_cast<int>(state.range(1));
  config.max_particles = static_cast<int>(state.range(0));
  ScanRays rays;
  select_rays(make_scan(office, kPose, test::ScanModel(), 0.0), Pose2(), config, 0, 0.0, config.measurement.evidence_power, &rays);
  Belief belief(config);
  belief.spread_around(kPose, Eigen::Vector3d(0.01, 0.01, 0.003).asDiagonal());
  std::vector<float> cost;
  for (auto _ : state) mean_prices(fields.fine, rays.points, belief.particles(), &cost, code);
  state.counters["ns_per_reading"] =
      benchmark::Counter(static_cast<double>(state.range(0) * state.range(1)) * 1e-9,
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK_CAPTURE(mean_prices_of, best, PriceCode::kBest)->Args({300, 720})->Args({2000, 3600})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(mean_prices_of, avx2, PriceCode::kAvx2)->Args({2000, 3600})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(mean_prices_of, plain, PriceCode::kPlain)->Args({2000, 3600})->Unit(benchmark::kMillisecond);

/// Offices side by side, 200 x 150 m in cells of 5 cm.
DistanceMap large_map() {
  const DistanceMap office = test::office().distance_map();
  DistanceMap map;
  map.geometry = office.geometry;
  map.geometry.width_cells = 4000;
  map.geometry.height_cells = 3000;
  map.distance_m.resize(map.geometry.cell_count());
  for (int iy = 0; iy < 3000; ++iy) {
    for (int ix = 0; ix < 4000; ++ix) {
      map.distance_m[map.geometry.index(ix, iy)] = office.at(ix % office.geometry.width_cells, iy % office.geometry.height_cells);
    }
  }
  return map;
}

/// From the map's arrival to the first scan that is weighed.
void BM_LargeMapReady(benchmark::State& state) {
  const DistanceMap map = large_map();
  for (auto _ : state) {
    Localizer localizer{LocalizerConfig()};
    localizer.set_map(map);
    benchmark::DoNotOptimize(checksum_of(localizer.map()));
  }
}
BENCHMARK(BM_LargeMapReady)->Unit(benchmark::kMillisecond);

/// The same from a plain occupancy map, whose distances must be found first.
void BM_LargeOccupancyReady(benchmark::State& state) {
  const DistanceMap map = large_map();
  OccupancyGrid grid;
  grid.geometry = map.geometry;
  for (const float d : map.distance_m) grid.value.push_back(std::isnan(d) ? std::int8_t{-1} : d <= 0.0f ? std::int8_t{100} : std::int8_t{0});
  for (auto _ : state) {
    Localizer localizer{LocalizerConfig()};
    localizer.set_map(distance_from_occupancy(grid));
    benchmark::DoNotOptimize(checksum_of(localizer.map()));
  }
}
BENCHMARK(BM_LargeOccupancyReady)->Unit(benchmark::kMillisecond);

void BM_CheckPose(benchmark::State& state) {
  const test::Building office = test::office();
  const LocalizerConfig config;
  const DistanceMap map = office.distance_map();
  ScanRays rays;
  select_rays(make_scan(office, kPose, test::ScanModel(), 0.0), Pose2(), config, 0, 0.0, config.measurement.evidence_power, &rays);
  for (auto _ : state)
    benchmark::DoNotOptimize(check_pose(map, rays, kPose, config.measurement, config.health, true));
}
BENCHMARK(BM_CheckPose)->Unit(benchmark::kMicrosecond);

void BM_Update(benchmark::State& state) {
  const test::Building office = test::office();
  Localizer localizer{LocalizerConfig()};
  localizer.set_map(office.distance_map());
  localizer.initialize(kPose, Eigen::Vector3d(0.01, 0.01, 0.003).asDiagonal());
  RangeScan scan = make_scan(office, kPose, test::ScanModel(), 0.0);
  for (auto _ : state) {
    scan.stamp_s += 0.3;  // each scan is weighed
    localizer.update(scan, Pose2(), kPose, 1);
  }
}
BENCHMARK(BM_Update)->Unit(benchmark::kMillisecond);

void BM_SearchStep(benchmark::State& state) {
  const test::Building office = test::office();
  const LocalizerConfig config;
  const MapFields fields = make_map_fields(office.distance_map(), config.measurement, config.global_search);
  ScanRays rays;
  select_rays(make_scan(office, kPose, test::ScanModel(), 0.0), Pose2(), config, 0, 0.0, config.measurement.evidence_power, &rays);
  GlobalSearch search(config.global_search, config.measurement, config.health);
  for (auto _ : state) {
    if (!search.running()) search.start(fields, rays, {}, false);
    search.step(fields);
  }
}
BENCHMARK(BM_SearchStep)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace knav
