#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/file_io.h"
#include "global_map_builder/map_directory.h"
#include "kinect_sim/map_evaluation.h"
#include "ros_common/command_line.h"

namespace {

constexpr char kHelp[] =
    "Compares a map with the simulated building it was made in, after one rigid alignment that starts where "
    "the true\n"
    "trajectory starts (the map's origin).\n"
    "JSON:\n"
    "  map_rmse_m              contour to nearest true surface in the sensor's slice (0.05-2 m); more than 1 "
    "m counts\n"
    "                          as 1 m\n"
    "  map_median_m, map_percentile_95_m, map_outlier_fraction (contour over 0.3 m off)\n"
    "  map_completeness        of the true surface that was seen (within --range, unhidden, from 3 poses at "
    "least),\n"
    "                          the share that has contour within --match\n"
    "  visible_length_m, missed_length_m, contour_length_m\n"
    "  alignment_x_m, alignment_y_m, alignment_yaw_deg  what the alignment moved the map by\n"
    "Picture: true surfaces grey, contour blue, missed surface red, trajectory green.";

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(kHelp, "evaluate_map");
  std::string map_path, world_path, truth_path, json, picture;
  knav::MapEvaluationConfig config;
  app.add_option("MAP_DIR", map_path, "Map directory, or the YAML file of a map_server map")->required();
  app.add_option("--world", world_path, "World file")->required();
  app.add_option("--truth-trajectory", truth_path, "TUM file of the mapping drive's true poses in the world")
      ->required();
  app.add_option("--range", config.range_m, "How far the sensor is expected to map [m]")
      ->check(CLI::Range(1.0, 30.0));
  app.add_option("--match", config.match_m, "How near contour must lie [m]")->check(CLI::Range(0.01, 1.0));
  app.add_option("--json", json, "JSON file to write (- for standard output)");
  app.add_option("--picture", picture, "PNG file to write");
  return knav::run_command(app, argc, argv, [&] {
    const knav::MapDirectory map = knav::load_map(map_path);
    const knav::WorldConfig world = knav::load_world(world_path);
    const knav::Trajectory truth = knav::read_trajectory(truth_path);
    const knav::MapEvaluation e = knav::evaluate_map(map.distance, world, truth, config);
    const auto missed = static_cast<double>(e.missed.size()) /
                        static_cast<double>(std::max<std::size_t>(1, e.visible.size()));
    const nlohmann::json figures = {{"map_rmse_m", e.rmse_m},
                                    {"map_median_m", e.median_m},
                                    {"map_percentile_95_m", e.percentile_95_m},
                                    {"map_outlier_fraction", e.outlier_fraction},
                                    {"map_completeness", e.completeness},
                                    {"visible_length_m", e.visible_length_m},
                                    {"missed_length_m", missed * e.visible_length_m},
                                    {"contour_length_m", e.contour_length_m},
                                    {"alignment_x_m", e.T_start_map.x_m},
                                    {"alignment_y_m", e.T_start_map.y_m},
                                    {"alignment_yaw_deg", e.T_start_map.yaw_rad * 180.0 / knav::kPi}};
    if (!picture.empty()) {
      std::vector<unsigned char> bytes;
      cv::imencode(".png", knav::evaluation_picture(e, world, truth, config), bytes);
      knav::write_text_atomically(picture, std::string(bytes.begin(), bytes.end()));
    }
    knav::write_json(json, figures.dump(2));
    if (json != "-") {
      fmt::print(
          "contour to walls: rmse {:.3f} m, median {:.3f} m; {:.1f} % of {:.0f} m visible wall mapped\n",
          e.rmse_m, e.median_m, 100.0 * e.completeness, e.visible_length_m);
    }
  });
}
