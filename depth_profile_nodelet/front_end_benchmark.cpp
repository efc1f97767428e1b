// Cost of each stage of the front end on one 640 x 480 frame: floor, walls and furniture with the Kinect's
// noise.
#include <benchmark/benchmark.h>

#include "depth_profile_nodelet/front_end.h"
#include "test/depth_profile_nodelet/analytic_scene.h"

namespace knav {
namespace {

struct Setup {
  Setup() {
    test::Scene scene;
    scene.floor();
    scene.wall(7.0);
    scene.box(2.5, -0.9, 0.4, 0.5, 0.0, 0.4);
    scene.box(3.5, 0.2, 0.5, 0.8, 0.0, 1.2);
    metres = test::render(scene, camera, test::mount(0.5, 0.7, 0.9));
    test::add_kinect_noise(&metres, 1);
    millimetres = test::to_millimetres(metres);
    for (int i = -50; i < 50; ++i) odometry.add(10.0 + 0.01 * i, {0.0, 0.0, 0.005 * i});
    for (double& offset : calibration.inverse_depth_offset_per_m) offset = 0.002;
    for (double& a : calibration.quadratic_a_per_m) a = 0.001;
  }
  PinholeModel camera = test::kinect_camera();
  cv::Mat metres, millimetres;
  PoseBuffer odometry;
  DepthCalibration calibration = DepthCalibration::identity(640, 480, 16);
};
Setup& setup() {
  static Setup instance;
  return instance;
}

void correct(benchmark::State& state, const char* model, bool distorted) {
  DepthCorrectionConfig config;
  config.model = model;
  DepthCorrector corrector(config, setup().calibration);
  RawCamera camera;
  camera.raw = camera.rectified = setup().camera;
  if (distorted) camera.distortion = {-0.1, 0.05, 0.0, 0.0, 0.0};
  cv::Mat out;
  for (auto _ : state) corrector.correct(setup().millimetres, camera, &out);
}
BENCHMARK_CAPTURE(correct, default_model, "default", false)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(correct, default_model_and_lens, "default", true)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(correct, paper_model, "paper", false)->Unit(benchmark::kMicrosecond);

void rolling_shutter(benchmark::State& state) {
  RollingShutterCorrector corrector{RollingShutterConfig{}};
  cv::Mat out;
  for (auto _ : state) corrector.correct(setup().metres, setup().camera, 10.0, setup().odometry, &out);
}
BENCHMARK(rolling_shutter)->Unit(benchmark::kMicrosecond);

void floor_plane_fit(benchmark::State& state) {
  FloorPlaneFit fit{FloorFitConfig{}};
  for (auto _ : state) fit.fit(setup().metres, setup().camera, 10.0, test::mount());
}
BENCHMARK(floor_plane_fit)->Unit(benchmark::kMicrosecond);

void floor_removal(benchmark::State& state) {
  FloorRemover remover{FloorRemovalConfig{}};
  cv::Mat out;
  FloorResult result;
  for (auto _ : state) remover.process(setup().metres, setup().camera, 10.0, test::mount(), &out, &result);
}
BENCHMARK(floor_removal)->Unit(benchmark::kMicrosecond);

void depth_profile(benchmark::State& state) {
  FloorRemover remover{FloorRemovalConfig{}};
  cv::Mat sliced;
  FloorResult floor;
  remover.process(setup().metres, setup().camera, 10.0, test::mount(), &sliced, &floor);
  ProfileExtractor extractor{DepthProfileConfig{}};
  DepthProfile profile;
  for (auto _ : state) {
    extractor.extract(sliced, setup().camera, 10.0, 0.5, floor.free_from_m, floor.free_to_m,
                      floor.height_class, &profile);
  }
}
BENCHMARK(depth_profile)->Unit(benchmark::kMicrosecond);

void whole_front_end(benchmark::State& state) {
  FrontEnd front_end{FrontEndConfig{}};
  DepthProfile profile;
  for (auto _ : state) {
    front_end.process(setup().millimetres, setup().camera, 10.0, test::mount(), setup().odometry, &profile);
  }
}
BENCHMARK(whole_front_end)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace knav
