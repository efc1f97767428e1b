#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/quantile.h"
#include "sensor_benchmark/free_places.h"
#include "sensor_benchmark/scene_runner.h"

namespace knav {
namespace {

constexpr double kBand_m[] = {0.5, 5.0, 10.0, 20.0};
constexpr int kBands = 3;
constexpr double kSway_deg = 1.0;

struct Band {
  std::vector<double> error;  ///< relative, signed
  double columns = 0.0, silent = 0.0;

  nlohmann::json json(int band) const {
    std::vector<double> sizes;
    for (const double e : error) sizes.push_back(std::abs(e));
    return {{"from_m", kBand_m[band]},
            {"to_m", kBand_m[band + 1]},
            {"columns", columns},
            {"median_error_percent", 100 * quantile(sizes, 0.5)},
            {"p90_error_percent", 100 * quantile(sizes, 0.9)},
            {"median_bias_percent", 100 * quantile(error, 0.5)},
            {"no_reading_percent_of_columns", 100 * silent / std::max(1.0, columns)}};
  }
};

}  // namespace

nlohmann::json measure_profile(const SensorBenchmarkOptions& options, Devices* devices,
                               std::vector<Check>* checks) {
  const char* const names[] = {"default", "paper"};
  nlohmann::json result;
  const int frames = options.quick ? 8 : 60;
  const std::vector<std::string> presets = {"default", "harsh"};
  const std::vector<std::string> worlds = {"demo_building", "brin_building"};
  double done = 0.0;
  const double all = static_cast<double>(presets.size() * worlds.size()) * devices->count();
  for (const std::string& preset : presets) {
    Band bands[2][kBands];
    for (const std::string& name : worlds) {
      const WorldConfig world = load_world(options.worlds + "/" + name + ".yaml");
      for (int device = 0; device < devices->count(); ++device) {
        SceneRunner runner(world, preset, device, options, devices);
        RandomStream random(devices->seed(device), random_stream::kSensorBenchmark, 6, 0);
        for (const Pose2& place : free_places(world, 0.5, frames, devices->seed(device) + 1)) {
          runner.reset();
          const Sway sway(kSway_deg, &random);
          const Way way = arc(place, 0.4, random.uniform(-1.0, 1.0));
          const SceneRunner::View& view = runner.look(way, sway, 0.2);
          for (std::size_t u = 0; u < view.true_z_m.size(); ++u) {
            const double truth = view.true_z_m[u];
            for (int band = 0; band < kBands; ++band) {
              if (!(truth >= kBand_m[band] && truth < kBand_m[band + 1])) continue;
              for (const int which : {SceneRunner::kOurs, SceneRunner::kPaper}) {
                const double z = view.profile[which].z_m[u];
                bands[which][band].columns += 1.0;
                if (std::isnan(z)) {
                  bands[which][band].silent += 1.0;
                } else {
                  bands[which][band].error.push_back(z / truth - 1.0);
                }
              }
            }
          }
        }
        options.progress((done += 1.0) / all, "profile");
      }
    }
    for (const int which : {SceneRunner::kOurs, SceneRunner::kPaper}) {
      nlohmann::json rows = nlohmann::json::array();
      for (int band = 0; band < kBands; ++band) rows.push_back(bands[which][band].json(band));
      result[preset][names[which]] = rows;
      if (which != SceneRunner::kOurs) continue;
      const double limits[] = {1.0, 2.0, preset == "harsh" ? 8.0 : 5.0};
      for (int band = 0; band < kBands; ++band) {
        if (preset == "harsh" && band < 2) continue;
        checks->push_back({fmt::format("profile: median error {:.0f}-{:.0f} m, {} sensor [%]", kBand_m[band],
                                       kBand_m[band + 1], preset),
                           rows[static_cast<std::size_t>(band)]["median_error_percent"].get<double>(),
                           limits[band]});
      }
    }
  }
  return result;
}

}  // namespace knav
