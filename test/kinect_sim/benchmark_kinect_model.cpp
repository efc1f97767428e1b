// What the Kinect's faults cost a simulated frame.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "kinect_sim/kinect_model.h"

namespace knav {
namespace {

constexpr int kWidth = 640, kHeight = 480;

/// A floor half a metre below, a slanted wall, boxes before it.
std::vector<float> hall_m() {
  std::vector<float> z_m;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const double x = (u - 319.5) / 585.0, y = (v - 239.5) / 585.0;
      double nearest = 6.0 / (1.0 + 0.3 * x);
      if (y > 0.01) nearest = std::min(nearest, 0.5 / y);
      if (u / 80 % 3 == 1 && v > 150) nearest = std::min(nearest, 2.0);
      z_m.push_back(static_cast<float>(nearest));
    }
  }
  return z_m;
}

void sense_frame(benchmark::State& state) {
  KinectModel kinect(KinectConfig::preset("default"), {kWidth, kHeight, 585.0, 585.0, 319.5, 239.5}, 1, 7);
  std::vector<float> z_m = hall_m(), signal(kWidth, 0.5f);
  std::vector<std::uint16_t> depth_mm(kWidth);
  std::uint64_t frame = 0;
  for (auto _ : state) {
    kinect.start_frame(frame++);
    for (int v = 0; v < kHeight; ++v)
      kinect.sense_row(v, {&z_m[static_cast<std::size_t>(v * kWidth)], signal.data()}, depth_mm.data());
    benchmark::DoNotOptimize(depth_mm.data());
  }
}
BENCHMARK(sense_frame)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace knav
