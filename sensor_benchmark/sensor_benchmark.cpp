// sensor_benchmark: the sensor end against the simulator's truth.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "ros_common/command_line.h"
#include "sensor_benchmark/sections.h"

namespace knav {
namespace {

using Section = nlohmann::json (*)(const SensorBenchmarkOptions&, Devices*, std::vector<Check>*);
const std::vector<std::pair<std::string, Section>> kSections = {{"calibration", measure_calibration},
                                                                {"rolling_shutter", measure_rolling_shutter},
                                                                {"floor", measure_floor},
                                                                {"profile", measure_profile},
                                                                {"cost", measure_cost}};

const char* const kHelp =
    R"(Sections: calibration (bias on walls not fitted, by distance and model), rolling_shutter (columns of
vertical edges), floor (driving with pitch, roll and bumps; walls, crowds, boxes, tables, signs, stairs), profile (error
against the true nearest obstacle), cost (CPU time). The JSON holds each section's figures and `checks`: name, value,
limit, holds. Without --strict the exit code says nothing about the checks.)";

/// Of the installed package, or of the source tree that this program was built from.
std::string worlds_folder() {
  std::error_code ignored;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", ignored);
  const std::filesystem::path installed =
      program.parent_path().parent_path().parent_path() / "share/kinect_nav/config/worlds";
  return std::filesystem::is_directory(installed) ? installed.string()
                                                  : std::string(KINECT_NAV_SOURCE_DIR) + "/config/worlds";
}

void run(const SensorBenchmarkOptions& base, const std::vector<std::string>& only,
         const std::string& json_path, const std::string& out, bool strict) {
  SensorBenchmarkOptions options = base;
  if (!std::filesystem::is_directory(options.worlds))
    throw UserError(options.worlds + ": no such folder; give the world files' with --worlds.");
  Devices devices(options);
  std::vector<Check> checks;
  nlohmann::json result = {{"seed", options.seed},
                           {"devices", options.devices},
                           {"quick", options.quick},
                           {"config", options.config.empty() ? "defaults" : options.config}};
  for (const auto& [name, section] : kSections) {
    if (!only.empty() && std::find(only.begin(), only.end(), name) == only.end()) continue;
    Progress progress("sensor_benchmark: " + name);
    options.progress = [&](double fraction, const std::string& note) {
      stop_if_interrupted();
      progress.update(fraction, note);
    };
    result[name] = section(options, &devices, &checks);
  }
  bool all_hold = true;
  result["checks"] = nlohmann::json::array();
  for (const Check& check : checks) {
    all_hold = all_hold && check.holds();
    fmt::print("{:70} {:9.3f}  asked {} {:<6g} {}\n", check.name, check.value,
               check.at_most ? "<=" : ">=", check.limit, check.holds() ? "holds" : "DOES NOT HOLD");
    result["checks"].push_back({{"name", check.name},
                                {"value", check.value},
                                {"limit", check.limit},
                                {"at_most", check.at_most},
                                {"holds", check.holds()}});
  }
  if (!out.empty()) {
    std::filesystem::create_directories(out);
    write_json(out + "/sensor_benchmark.json", result.dump(2));
  }
  write_json(json_path, result.dump(2));
  if (strict && !all_hold) throw UserError("not every check holds.");
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Measures calibration, rolling shutter, floor removal and profile against the simulator's truth.");
  knav::SensorBenchmarkOptions options;
  std::vector<std::string> only;
  std::string json, out;
  bool strict = false;
  std::vector<std::string> names;
  for (const auto& [name, section] : knav::kSections) names.push_back(name);
  options.worlds = knav::worlds_folder();
  app.add_flag("--quick", options.quick, "fewer frames and distances: under a minute");
  app.add_option("--only", only, "sections, separated by commas")
      ->delimiter(',')
      ->check(CLI::IsMember(names));
  app.add_option("--json", json, "write the figures to this file (- for standard output)");
  app.add_option("--out", out, "write sensor_benchmark.json into this folder");
  app.add_option("--devices", options.devices, "simulated devices")
      ->check(CLI::Range(1, 50))
      ->capture_default_str();
  app.add_option("--seed", options.seed, "of all noise")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--config", options.config, "configuration file whose front end is measured as `default`");
  app.add_option("--worlds", options.worlds, "folder of the world files")->capture_default_str();
  app.add_flag("--strict", strict, "exit code 1 if a check does not hold");
  app.footer(knav::kHelp);
  return knav::run_command(app, argc, argv, [&] { knav::run(options, only, json, out, strict); });
}
