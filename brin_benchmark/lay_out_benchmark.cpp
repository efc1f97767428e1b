// lay_out_benchmark: places, a mapping tour and changes for any simulated building, so that it can be scored.
#include <fmt/format.h>

#include <filesystem>

#include "brin_benchmark/layout.h"
#include "core/error.h"
#include "core/file_io.h"
#include "ros_common/command_line.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

struct Options {
  std::string world, prefix;
  LayoutConfig layout;
};

void run(const Options& options) {
  const WorldConfig given = load_world(options.world, StartMustBe::kAnywhere), world = started_inside(given, options.layout.robot_radius_m);
  if (world.spawn.x_m != given.spawn.x_m || world.spawn.y_m != given.spawn.y_m) {
    fmt::print("The start, [{:g}, {:g}], is not inside the building; it is now [{:g}, {:g}], in its largest part.\n",
               given.spawn.x_m, given.spawn.y_m, world.spawn.x_m, world.spawn.y_m);
  }
  const fs::path prefix(options.prefix);
  const std::string tour_file = options.prefix + "_tour.yaml",
                    changes_file = options.prefix + "_changes.yaml";
  const Layout layout = lay_out(world, options.layout, fs::path(tour_file).filename().string());
  write_text_atomically(tour_file, layout.tour);
  write_text_atomically(changes_file, layout.changes);
  std::string world_file = options.world;
  if (world.places.empty()) {
    world_file = options.prefix + "_world.yaml";
    const fs::path folder = fs::absolute(prefix).parent_path();
    std::string text = fmt::format("base: {}\nname: {}\nspawn: [{:g}, {:g}, {:g}]\nplaces:\n",
                                   fs::relative(options.world, folder).string(), world.name, world.spawn.x_m,
                                   world.spawn.y_m, world.spawn.yaw_rad * 180.0 / kPi);
    for (const auto& [name, pose] : layout.places) {
      text += fmt::format("  {}: [{:.2f}, {:.2f}, {:.0f}]\n", name, pose.x_m, pose.y_m,
                          pose.yaw_rad * 180.0 / kPi);
    }
    write_text_atomically(world_file, text);
  }
  fmt::print("{} places, {} legs, {} runs:\nbrin_benchmark --world {} --changes {} --out FOLDER\n",
             layout.places.size(), layout.sequence.size(), options.layout.runs, world_file, changes_file);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Lays out a benchmark in a simulated building: places if it names none, a mapping tour, and a set of "
      "changes for\n"
      "every run (people, obstacles, doors, moved furniture, sun). Writes PREFIX_tour.yaml, "
      "PREFIX_changes.yaml and, if the\n"
      "world names no places, PREFIX_world.yaml. They are meant to be read and edited.");
  knav::Options options;
  app.add_option("WORLD", options.world, "world file, e.g. an occupancy image extruded")->required();
  app.add_option("PREFIX", options.prefix, "path and beginning of the files' names")->required();
  app.add_option("--runs", options.layout.runs, "how many")->check(CLI::Range(1, 99))->capture_default_str();
  app.add_option("--places", options.layout.places, "where the world names none")
      ->check(CLI::Range(2, 99))
      ->capture_default_str();
  app.add_option("--length", options.layout.sequence_m, "of every run [m]")
      ->check(CLI::Range(1.0, 1e5))
      ->capture_default_str();
  app.add_option("--seed", options.layout.seed, "of all that is drawn")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  return knav::run_command(app, argc, argv, [&] { knav::run(options); });
}
