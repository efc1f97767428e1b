#include <algorithm>
#include <cmath>

#include "sensor_benchmark/free_places.h"
#include "sensor_benchmark/obstacle_scenes.h"
#include "sensor_benchmark/scene_runner.h"

namespace knav {
namespace {

constexpr double kFramePeriod_s = 1.0 / 15.0;
constexpr int kFramesPerDrive = 20;

struct Phantoms {
  double columns = 0.0, wrong = 0.0;
  int frames = 0, frames_without_fit = 0;
};

/// A column in which the profile says something stands where nothing does.
bool phantom(float z_m, float nearest_true_m) {
  if (std::isnan(z_m)) return false;
  return std::isnan(nearest_true_m) || z_m < 0.93f * nearest_true_m - 0.05f;
}

}  // namespace

nlohmann::json measure_floor(const SensorBenchmarkOptions& options, Devices* devices,
                             std::vector<Check>* checks) {
  const WorldConfig world = load_world(options.worlds + "/demo_building.yaml");
  const int drives = options.quick ? 2 : 21;
  Phantoms phantoms[2];
  for (int device = 0; device < devices->count(); ++device) {
    SceneRunner runner(world, "default", device, options, devices);
    const std::vector<Pose2> starts = free_places(world, 0.6, drives, devices->seed(device));
    RandomStream random(devices->seed(device), random_stream::kSensorBenchmark, 4, 0);
    for (int drive = 0; drive < drives; ++drive) {
      runner.reset();
      const Sway sway(2.0, &random);
      // Slow enough to stay within the free space around its start.
      const Way way = arc(starts[static_cast<std::size_t>(drive)], 0.25, random.uniform(-1.0, 1.0));
      for (int i = 0; i < kFramesPerDrive; ++i) {
        const SceneRunner::View& view = runner.look(way, sway, i * kFramePeriod_s);
        for (const int which : {SceneRunner::kOurs, SceneRunner::kPaper}) {
          Phantoms& p = phantoms[which];
          ++p.frames;
          p.frames_without_fit += runner.front_end(which).floor().source == FloorSource::kFrame ? 0 : 1;
          for (std::size_t u = 0; u < view.true_z_m.size(); ++u) {
            p.columns += 1.0;
            p.wrong += phantom(view.profile[which].z_m[u], least_near(view.true_z_m, u, 4)) ? 1.0 : 0.0;
          }
        }
      }
      options.progress(0.5 * (device + static_cast<double>(drive) / drives) / devices->count(), "floor");
    }
  }
  nlohmann::json result;
  const char* const names[] = {"default", "paper"};
  for (const int which : {SceneRunner::kOurs, SceneRunner::kPaper}) {
    const Phantoms& p = phantoms[which];
    result["driving"][names[which]] = {
        {"frames", p.frames},
        {"floor_as_obstacle_percent_of_columns", 100 * p.wrong / p.columns},
        {"frames_without_fit_percent", 100.0 * p.frames_without_fit / p.frames}};
  }
  checks->push_back(
      {"floor: columns with floor as obstacle [%]", 100 * phantoms[0].wrong / phantoms[0].columns, 0.1});
  result["scenes"] = measure_obstacle_scenes(options, devices, checks);
  return result;
}

}  // namespace knav
