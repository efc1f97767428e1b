// localizer_benchmark: how accurate and how honest the localizer is, and how it recovers, on simulated drives.
#include <fmt/format.h>

#include <cmath>

#include "core/error.h"
#include "core/file_io.h"
#include "localizer_benchmark/rows.h"
#include "ros_common/command_line.h"
#include "tools/simulated_recordings.h"

namespace knav {
namespace {

constexpr char kHelp[] =
    "Simulates drives through buildings (once; kept in --cache, about 200 MB for 250 m), maps them with the local mapper, and "
    "localizes\n"
    "them in a map made from the truth, or in one given by --map. Rows:\n"
    "  tracking   --metres in the building that the map shows, started from a given pose\n"
    "  changed    the same with 30 % of the furniture moved, doors closed and ten people\n"
    "  plain57    the unchanged drives with the 57-degree scan alone and odometry, no local mapper: the paper's first system\n"
    "  harsh      250 m with a bad Kinect, uncalibrated\n"
    "  starts     switched on without a hint where the view matches one place only (exhaustive search); 30 s of driving\n"
    "  ambiguous  the same where it matches several\n"
    "  kidnaps    carried elsewhere while everything runs, a few seconds before a look round; 40 s of driving";
constexpr char kJsonHelp[] =
    "The JSON is a list of rows. All: row, building, map, honesty: {time_s, ok_s, uncertain_s, lost_s, initializing_s, "
    "ok_wrong_s (ok while\n"
    "more than 0.5 m off; for kidnaps the first 5 s are left out)}. Tracking rows: path_m, mean_m, p95_m, worst_m, worst_at, "
    "mean_deg, p95_deg, worst_deg,\n"
    "lost_spans (more than 1 m off for more than 5 s), drives[]. Recovery rows: trials, noticed (not ok within 5 s), right (ok, "
    "within 0.3 m and\n"
    "5 deg in time), medians, each[].";

struct Options {
  LocalizerBenchmarkOptions benchmark;
  std::vector<std::string> rows = LocalizerRows::names(), buildings, tours, maps;
  std::string json, markdown, trace;
  bool record_only = false;
};

std::pair<std::string, std::string> named(const std::string& option, const std::string& text) {
  const auto equals = text.find('=');
  if (equals == std::string::npos) throw UserError(fmt::format("{} '{}': must be NAME=FILE.", option, text));
  return {text.substr(0, equals), text.substr(equals + 1)};
}

bool is_recovery(const nlohmann::json& row) { return row.contains("trials"); }

void print_line(const nlohmann::json& r) {
  const nlohmann::json& h = r["honesty"];
  const std::string name = fmt::format("{} {}", r["building"].get<std::string>(), r["row"].get<std::string>());
  const auto number = [&](const char* key) { return r[key].is_number() ? r[key].get<double>() : std::nan(""); };
  if (is_recovery(r)) {
    fmt::print("{:<22} right {} of {}, median {:.1f} s; noticed {}, median {:.1f} s; ok while wrong {:.2f} s of {:.0f} s\n", name,
               r["right"].get<int>(), r["trials"].get<int>(), number("right_median_s"), r["noticed"].get<int>(),
               number("noticed_median_s"), h["ok_wrong_s"].get<double>(), h["time_s"].get<double>());
  } else {
    fmt::print("{:<22} {:.0f} m: mean {:.3f} m {:.2f} deg, p95 {:.3f} m, worst {:.2f} m {:.1f} deg; ok {:.1f} %, lost {}; ok while wrong {:.2f} s of {:.0f} s\n",
               name, number("path_m"), number("mean_m"), number("mean_deg"), number("p95_m"), number("worst_m"), number("worst_deg"),
               h["ok_percent"].get<double>(), r["lost_spans"].get<int>(), h["ok_wrong_s"].get<double>(), h["time_s"].get<double>());
  }
  std::fflush(stdout);
}

std::string markdown(const nlohmann::json& rows) {
  std::string tracking = "| building | row | way | mean | p95 | worst | heading: mean, worst | ok | lost | ok while > 0.5 m off |\n|---|---|---|---|---|---|---|---|---|---|\n";
  std::string recovery = "| building | row | right in time | median, 95 % | not ok within 5 s | ok while > 0.5 m off |\n|---|---|---|---|---|---|\n";
  double wrong_s = 0.0, time_s = 0.0;
  for (const auto& r : rows) {
    const nlohmann::json& h = r["honesty"];
    const auto number = [&](const char* key) { return r[key].is_number() ? r[key].get<double>() : std::nan(""); };
    const std::string map = r["map"] == "built" ? ", built map" : "";
    const std::string off = fmt::format("{:.2f} s of {:.0f} s", h["ok_wrong_s"].get<double>(), h["time_s"].get<double>());
    if (r["row"] != "plain57") {
      wrong_s += h["ok_wrong_s"].get<double>();
      time_s += h["time_s"].get<double>();
    }
    if (is_recovery(r)) {
      recovery += fmt::format("| {} | {}{} | {} of {} | {:.1f}, {:.1f} s | {} | {} |\n", r["building"].get<std::string>(), r["row"].get<std::string>(), map,
                              r["right"].get<int>(), r["trials"].get<int>(), number("right_median_s"), number("right_p95_s"),
                              r["row"] == "kidnaps" ? fmt::format("{} of {}", r["noticed"].get<int>(), r["trials"].get<int>()) : "", off);
    } else {
      tracking += fmt::format("| {} | {}{} | {:.0f} m | {:.3f} m | {:.3f} m | {:.2f} m | {:.2f}, {:.1f} deg | {:.1f} % | {} | {} |\n", r["building"].get<std::string>(),
                              r["row"].get<std::string>(), map, number("path_m"), number("mean_m"), number("p95_m"), number("worst_m"), number("mean_deg"),
                              number("worst_deg"), h["ok_percent"].get<double>(), r["lost_spans"].get<int>(), off);
    }
  }
  return tracking + "\n" + recovery + fmt::format("\nok while more than 0.5 m off, over all rows but plain57: {:.3f} % of {:.0f} s.\n", time_s > 0.0 ? 100.0 * wrong_s / time_s : 0.0, time_s);
}

void benchmark(Options options) {
  if (options.buildings.empty()) options.buildings = {"brin=config/worlds/brin_building.yaml"};
  std::vector<BuildingSource> sources;
  for (const std::string& text : options.buildings) sources.push_back(parse_building(text));
  for (const std::string& text : options.tours) {
    const auto [name, file] = named("--tour", text);
    for (BuildingSource& source : sources) {
      if (source.name == name) source.tour_file = file;
    }
  }
  for (const std::string& text : options.maps) options.benchmark.maps.insert(named("--map", text));
  LocalizerRows rows(options.benchmark, sources);
  nlohmann::json json = nlohmann::json::array();
  for (const std::string& row : options.rows) {
    for (std::size_t b = 0; b < sources.size(); ++b) {
      if (row == "changed") fmt::print(stderr, "{} ({} prisms), changed: {}.\n", sources[b].name, rows.building(b).solids, rows.building(b).changes);
      if (options.record_only) {
        rows.record(row, b);
        continue;
      }
      json.push_back(rows.measure(row, b, options.trace));
      print_line(json.back());
      // after each row, so that what was measured is there if the rest is interrupted
      if (options.json != "-") write_json(options.json, json.dump(1));
      if (!options.markdown.empty()) write_text_atomically(options.markdown, markdown(json));
    }
  }
  if (options.json == "-") write_json(options.json, json.dump(1));
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(knav::kHelp, "localizer_benchmark");
  knav::Options options;
  knav::LocalizerBenchmarkOptions& b = options.benchmark;
  b.cache = knav::default_cache();
  app.add_option("--rows", options.rows, "Which rows, separated by commas")
      ->delimiter(',')
      ->check(CLI::IsMember(knav::LocalizerRows::names()))
      ->capture_default_str();
  app.add_option("--building", options.buildings,
                 "NAME=WORLD.yaml or NAME=IMAGE@METRES_PER_PIXEL, an occupancy image that is extruded and furnished; may be "
                 "given several times; brin=config/worlds/brin_building.yaml if none is");
  app.add_option("--tour", options.tours, "NAME=FILE: a tour for the drives through that building while unchanged");
  app.add_option("--map", options.maps, "NAME=DIR: a built map for that building instead of the truth");
  app.add_option("--metres", b.metres, "Driven per row of tracking and building")->check(CLI::Range(10.0, 1e5))->capture_default_str();
  app.add_option("--starts", b.starts, "Starts without a hint, over all buildings")->check(CLI::Range(1, 10000))->capture_default_str();
  app.add_option("--kidnaps", b.kidnaps, "Kidnaps, over all buildings")->check(CLI::Range(1, 10000))->capture_default_str();
  app.add_option("--seed", b.seed, "Of all that is drawn")->check(CLI::Range(0, 1000000))->capture_default_str();
  app.add_option("--config", b.config, "Configuration file; its front end, 'local_mapper' and 'localizer' are used");
  app.add_option("--cache", b.cache, "Folder of the simulated drives")->capture_default_str();
  app.add_option("--json", options.json, "Write all figures here ('-' for standard output)");
  app.add_option("--markdown", options.markdown, "Write the tables here");
  app.add_option("--trace", options.trace, "Write BUILDING-ROW-K.tsv, verdict and error of every scan, into this existing folder");
  app.add_flag("--quick", b.quick, "The first 100 s of one drive, three starts, three kidnaps");
  app.add_flag("--fresh", b.fresh, "Simulate again what is in the cache (after a change of the simulator)");
  app.add_flag("--fresh-scans", b.fresh_scans, "Map again what is in the cache (after a change of the local mapper); kidnaps are always mapped anew");
  app.add_flag("--record-only", options.record_only, "Fill the cache only");
  app.footer(knav::kJsonHelp);
  return knav::run_command(app, argc, argv, [&] { knav::benchmark(options); });
}
