#include <ctime>

#include "core/quantile.h"
#include "sensor_benchmark/free_places.h"
#include "sensor_benchmark/scene_runner.h"

namespace knav {
namespace {

/// CPU time of this thread: others may be using the machine.
double now_ms() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

struct Stopwatch {
  std::vector<double> ms;
  template <class Work>
  void time(const Work& work) {
    const double start = now_ms();
    work();
    ms.push_back(now_ms() - start);
  }
  nlohmann::json json() const {
    return {
        {"median_ms", quantile(ms, 0.5)}, {"fastest_ms", quantile(ms, 0.0)}, {"p95_ms", quantile(ms, 0.95)}};
  }
};

}  // namespace

nlohmann::json measure_cost(const SensorBenchmarkOptions& options, Devices* devices,
                            std::vector<Check>* checks) {
  const WorldConfig world = load_world(options.worlds + "/demo_building.yaml");
  const FrontEndConfig config = default_front_end(options);
  SceneRunner runner(world, "default", 0, options, devices);
  const PinholeModel camera = runner.camera();
  DepthCorrector corrector(config.depth_correction, devices->calibration("default", 0));
  RollingShutterCorrector rolling(config.rolling_shutter);
  FloorRemover remover(config.floor_removal);
  ProfileExtractor extractor(config.depth_profile);
  FrontEnd whole(config, devices->calibration("default", 0));
  Stopwatch watch[5];
  const int frames = options.quick ? 20 : 100, repeats = 5;
  RandomStream random(devices->seed(0), random_stream::kSensorBenchmark, 7, 0);
  cv::Mat rectified, unrolled, sliced;
  FloorResult floor;
  DepthProfile profile;
  int done = 0;
  for (const Pose2& place : free_places(world, 0.5, frames, devices->seed(0) + 2)) {
    const Sway sway(1.0, &random);
    const double t_s = 0.2, stamp_s = 100.0 + t_s;
    const Way way = arc(place, 0.3, done % 2 == 0 ? 0.5 : -0.5);  // turning: the rolling shutter has work
    runner.look(way, sway, t_s);
    const cv::Mat& depth_mm = runner.depth_mm();
    const Eigen::Isometry3d T_base_optical =
        optical_frame(camera_mount({kCameraForward_m, 0.0, kCameraHeight_m}, 0.0, 0.0, 0.0));
    PoseBuffer odometry(32);
    for (int i = -5; i <= 5; ++i) odometry.add(stamp_s + 0.02 * i, way(t_s + 0.02 * i));
    for (int repeat = 0; repeat < repeats; ++repeat) {
      watch[0].time([&] { corrector.correct(depth_mm, camera, &rectified); });
      watch[1].time([&] { rolling.correct(rectified, camera, stamp_s, odometry, &unrolled); });
      watch[2].time([&] { remover.process(unrolled, camera, stamp_s, T_base_optical, &sliced, &floor); });
      watch[3].time([&] {
        extractor.extract(sliced, camera, stamp_s, floor.plane.height_m, floor.free_from_m, floor.free_to_m,
                          floor.height_class, &profile);
      });
      watch[4].time([&] { whole.process(depth_mm, camera, stamp_s, T_base_optical, odometry, &profile); });
    }
    options.progress(static_cast<double>(++done) / frames, "cost");
  }
  nlohmann::json result = {{"clock", "CPU time of one thread"}, {"frames", frames * repeats}};
  const char* const names[] = {"depth_correction", "rolling_shutter", "floor_removal", "depth_profile",
                               "whole_front_end"};
  for (int i = 0; i < 5; ++i) result[names[i]] = watch[i].json();
  checks->push_back({"cost: whole front end, median [ms]", quantile(watch[4].ms, 0.5), 2.5});
  return result;
}

}  // namespace knav
