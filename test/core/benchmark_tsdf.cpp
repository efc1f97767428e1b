// What a frame costs: integrate, remove, align, contour. Run with --benchmark_filter=... for one of them.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/contour.h"
#include "core/multiversion.h"
#include "core/random.h"
#include "core/tsdf_alignment.h"
#include "core/tsdf_grid.h"

#ifdef KNAV_HAVE_AVX2_CODE
#include <immintrin.h>
#endif

namespace knav {
namespace {

/// The shortest of several short repetitions: other work on the machine only ever lengthens one.
void shortest(benchmark::internal::Benchmark* b) {
  b->Repetitions(15)->ReportAggregatesOnly()->ComputeStatistics(
      "min", [](const std::vector<double>& v) { return *std::min_element(v.begin(), v.end()); });
}

/// A Kinect profile in a hall: the view's walls at `wall_m`, floor seen free from 1.3 m on.
TsdfObservation kinect_observation(double wall_m, std::uint32_t sequence) {
  DepthProfile profile;
  profile.fx_px = 585.0;
  profile.cx_px = 319.5;
  RandomStream random(1, random_stream::kTest, sequence, 0);
  for (int u = 0; u < 640; ++u) {
    const double noise_m = 0.0015 * wall_m * wall_m * random.normal();
    profile.z_m.push_back(static_cast<float>(wall_m + noise_m));
    profile.free_from_m.push_back(1.3f);
    profile.free_to_m.push_back(static_cast<float>(wall_m - 0.1));
    profile.height_class.push_back(HeightClass::kMiddle);
  }
  TsdfObservation o;
  observation_from(profile, ObservationLimits{}, &o);
  o.sequence = sequence;
  return o;
}

TsdfGrid hall(double wall_m, double resolution_m = TsdfConfig().resolution_m) {
  TsdfConfig config;
  config.resolution_m = resolution_m;
  TsdfGrid grid(config, 25.0);
  std::uint32_t sequence = 0;
  for (int k = 0; k < 36; ++k) {
    TsdfObservation o = kinect_observation(wall_m, ++sequence);
    o.T_map_sensor.yaw_rad = k * kPi / 18;
    grid.add(o);
  }
  return grid;
}

void prepare_observation(benchmark::State& state) {
  std::uint32_t sequence = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(kinect_observation(static_cast<double>(state.range(0)), ++sequence));
}
BENCHMARK(prepare_observation)->Arg(3)->Arg(18)->Unit(benchmark::kMicrosecond)->Apply(shortest);

void per_reading(benchmark::State& state, std::size_t count) {
  state.counters["ns_per_particle_reading"] =
      benchmark::Counter(static_cast<double>(state.iterations()) * static_cast<double>(count) * 120e-9,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

/// Arguments: distance of the walls [m], threads.
template <class Remove>
void integrate(benchmark::State& state, const Remove& remove) {
  TsdfConfig config;
  config.threads = static_cast<int>(state.range(1));
  TsdfGrid grid(config, 25.0);
  std::uint32_t sequence = 0;
  TsdfObservation o = kinect_observation(static_cast<double>(state.range(0)), 1);
  for (auto _ : state) {
    o.sequence = ++sequence;
    o.T_map_sensor.yaw_rad = 0.1 * sequence;
    grid.add(o);
    remove(o, &grid);
  }
}
/// By the clock on the wall: several threads take as much of the processors' time as one.
void distances_and_threads(benchmark::internal::Benchmark* b) {
  b->ArgsProduct({{3, 10, 18}, {1, 2}})->Unit(benchmark::kMicrosecond)->UseRealTime();
  shortest(b);
}

void integrate_and_remove(benchmark::State& state) {
  integrate(state, [](const TsdfObservation& o, TsdfGrid* grid) { grid->remove(o); });
}
BENCHMARK(integrate_and_remove)->Apply(distances_and_threads);

/// As the sliding window does: the part beyond window/far_m leaves by itself.
void integrate_and_remove_in_two_parts(benchmark::State& state) {
  integrate(state, [](const TsdfObservation& o, TsdfGrid* grid) {
    grid->remove(o, {6.0f});
    grid->remove(o, {0.0f, 6.0f});
  });
}
BENCHMARK(integrate_and_remove_in_two_parts)->Apply(distances_and_threads);

/// Arguments: particles, threads.
void align(benchmark::State& state) {
  const TsdfGrid grid = hall(8.0);
  const auto count = static_cast<std::size_t>(state.range(0));
  ParticleSet particles;
  particles.resize(count);
  RandomStream random(1, random_stream::kTest, 0, 0);
  for (std::size_t i = 0; i < count; ++i) {
    particles.set(i, {random.normal(0, 0.1), random.normal(0, 0.1), random.normal(0, 0.05)});
  }
  WeightedPoints points;
  for (int k = 0; k < 120; ++k) {
    const double right = (k - 59.5) / 110.0;
    points.add(8.0f, static_cast<float>(-8.0 * right), 1.0f);
  }
  std::vector<float> cost;
  for (auto _ : state) tsdf_alignment_costs(grid, points, particles, 0.6f, &cost, static_cast<int>(state.range(1)));
  per_reading(state, count);
}
BENCHMARK(align)->ArgsProduct({{1000, 2000, 10000, 50000}, {1, 2}})->Unit(benchmark::kMicrosecond)->UseRealTime()->Apply(shortest);

#ifdef KNAV_HAVE_AVX2_CODE
/// Particles within spread_m of the middle of a 1,024 x 1,024 grid of 5 cm, 120 readings up to 12 m away.
struct Crowd {
  Crowd(std::size_t count, double spread_m) {
    particles.resize(count);
    RandomStream random(1, random_stream::kTest, 1, 0);
    for (std::size_t i = 0; i < count; ++i) {
      particles.set(i, {random.uniform(-spread_m, spread_m), random.uniform(-spread_m, spread_m),
                        random.uniform(-0.1, 0.1) * spread_m});
    }
    for (int k = 0; k < 120; ++k) {
      const double angle = 0.05 * k, range_m = random.uniform(1.0, 12.0);
      points.add(static_cast<float>(range_m * std::cos(angle)), static_cast<float>(range_m * std::sin(angle)), 1.0f);
    }
    for (std::uint32_t& word : words) word = static_cast<std::uint32_t>(random.uniform() * 4294967295.0);
  }
  ParticleSet particles;
  WeightedPoints points;
  GridGeometry geometry{1024, 1024, 0.05, -25.6, -25.6};
  std::vector<std::uint32_t> words = std::vector<std::uint32_t>(1024 * 1024);
};

/// Arguments: particles, spread in centimetres.
void crowds(benchmark::internal::Benchmark* b) {
  for (const int spread_cm : {20, 1000}) {
    for (const int count : {2000, 10000, 50000}) b->Args({count, spread_cm});
  }
  b->Unit(benchmark::kMicrosecond);
  shortest(b);
}

KNAV_AVX2 int sum_at(const std::uint32_t* quads, const std::vector<int>& index) {
  __m256i sum = _mm256_setzero_si256();
  for (std::size_t k = 0; k + 8 <= index.size(); k += 8) {
    const __m256i at = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(&index[k]));
    sum = _mm256_add_epi32(sum, _mm256_i32gather_epi32(reinterpret_cast<const int*>(quads), at, 4));
  }
  return _mm256_extract_epi32(sum, 0) + _mm256_extract_epi32(sum, 5);
}
/// The limit: the same words read by the same instruction, and nothing else.
void bare_gather(benchmark::State& state) {
  const Crowd crowd(static_cast<std::size_t>(state.range(0)), 0.01 * static_cast<double>(state.range(1)));
  std::vector<int> index;
  for (std::size_t i = 0; i < crowd.particles.size(); ++i) {
    const Pose2 T = crowd.particles.pose(i);
    for (std::size_t k = 0; k < crowd.points.size(); ++k) {
      const Point2 p = T * Point2{crowd.points.x_m[k], crowd.points.y_m[k]};
      index.push_back(crowd.geometry.cell_y(p.y_m) * 1024 + crowd.geometry.cell_x(p.x_m));
    }
  }
  for (auto _ : state) benchmark::DoNotOptimize(sum_at(crowd.words.data(), index));
  per_reading(state, crowd.particles.size());
}
BENCHMARK(bare_gather)->Apply(crowds);
#endif

/// Arguments: distance of the walls [m], side of a cell [mm]: 25 makes a grid of 2,048^2, 50 one of 1,024^2.
void contour(benchmark::State& state) {
  const TsdfGrid grid = hall(static_cast<double>(state.range(0)), 0.001 * static_cast<double>(state.range(1)));
  RangeScan scan;
  for (auto _ : state) extract_contour(grid, ContourConfig{}, Pose2{}, 0.0f, &scan);
}
BENCHMARK(contour)->ArgsProduct({{3, 8, 18}, {25, 50}})->Unit(benchmark::kMicrosecond)->Apply(shortest);

}  // namespace
}  // namespace knav
