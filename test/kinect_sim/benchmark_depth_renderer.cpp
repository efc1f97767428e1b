// What drawing a depth image of the BRIN building costs, on a way through it.
#include <benchmark/benchmark.h>

#include <cmath>
#include <string>
#include <vector>

#include "kinect_sim/depth_renderer.h"
#include "kinect_sim/world.h"

namespace knav {
namespace {

void draw_frame(benchmark::State& state) {
  const WorldMeshes meshes(load_world(std::string(KINECT_NAV_SOURCE_DIR) + "/config/worlds/brin_building.yaml"));
  const PinholeModel camera{640, 480, 585.0, 585.0, 319.5, 239.5};
  DepthRenderer renderer(meshes, camera);
  DynamicState still;
  still.people.resize(64);
  still.door_open_rad.assign(64, 1.5);
  still.timed_solid_present.assign(64, 1);
  Eigen::Matrix3f R_base_optical;
  R_base_optical << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  std::vector<float> z_m(640), signal(640);
  float along = 0.0f;
  for (auto _ : state) {
    along = std::fmod(along + 0.37f, 30.0f);
    Eigen::Isometry3f T = Eigen::Isometry3f::Identity();
    T.linear() = Eigen::AngleAxisf(0.7f * along, Eigen::Vector3f::UnitZ()).toRotationMatrix() * R_base_optical;
    T.translation() << along, 0.0f, 0.5f;
    renderer.start_frame(still, T, T);
    for (int v = 0; v < camera.height_px; ++v) renderer.render_row(T, v, z_m.data(), signal.data());
    benchmark::DoNotOptimize(z_m.data());
  }
}
BENCHMARK(draw_frame)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace knav
