#include "brin_benchmark/protocol.h"

#include <fmt/format.h>

#include <filesystem>
#include <set>

#include "core/config.h"
#include "core/error.h"
#include "kinect_sim/yaml_map.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

BenchmarkRun read_run(const YAML::Node& node, const std::string& file, std::size_t index) {
  if (!node.IsMap())
    throw UserError(
        fmt::format("{}: line {}: 'runs[{}]' must be a map of keys.", file, node.Mark().line + 1, index));
  BenchmarkRun run;
  YAML::Node changes;
  for (const auto& entry : node) {
    const auto key = entry.first.as<std::string>();
    if (key == "name") {
      run.name = entry.second.as<std::string>();
    } else if (key == "base" || key == "spawn" || key == "places") {
      throw UserError(fmt::format("{}: line {}: 'runs[{}]/{}' cannot be changed by a run.", file,
                                  entry.first.Mark().line + 1, index, key));
    } else {
      changes[key] = entry.second;
    }
  }
  if (run.name.empty()) run.name = fmt::format("run {}", index + 1);
  if (changes.size() > 0) run.changes = YAML::Dump(changes);
  return run;
}

}  // namespace

BenchmarkProtocol load_protocol(const std::string& path) {
  BenchmarkProtocol protocol;
  protocol.file = path;
  YamlMap map(load_yaml_file(path), path, "");
  protocol.tour_file = (fs::path(path).parent_path() / map.text("tour")).string();
  for (const YAML::Node& name : map.nodes("sequence")) {
    if (!name.IsScalar()) map.fail("sequence", "must list names of places");
    protocol.sequence.push_back(name.as<std::string>());
  }
  if (protocol.sequence.empty()) map.fail("sequence", "must name at least one place");
  for (const YAML::Node& run : map.nodes("runs")) {
    protocol.runs.push_back(read_run(run, path, protocol.runs.size()));
  }
  if (protocol.runs.empty()) map.fail("runs", "must list at least one run");
  map.finish();
  return protocol;
}

WorldConfig changed_world(const std::string& world_path, const BenchmarkProtocol& protocol,
                          const BenchmarkRun& run) {
  const fs::path folder = fs::absolute(fs::path(protocol.file)).parent_path();
  YAML::Node base;
  base["base"] = fs::absolute(fs::path(world_path)).string();
  return parse_world(YAML::Dump(base) + "\n" + run.changes, fmt::format("{}, '{}'", protocol.file, run.name),
                     folder.string());
}

}  // namespace knav
