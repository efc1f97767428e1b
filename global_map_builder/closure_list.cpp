#include "global_map_builder/closure_list.h"

#include <fmt/format.h>

#include <cmath>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"

namespace knav {
namespace {

const char* const kHead =
    R"(# Every pair of visits that was looked at. Change `verdict` and build again with build_map --closures THIS_FILE:
#   auto   the builder decides      allow  the pair is joined by x_m, y_m, yaw_rad (the later pose in the earlier)
#   deny   it is kept out, and so is the same mistake between neighbouring poses
closures:
)";

const char* const kKeys[] = {"drives", "from_stamp_s", "to_stamp_s", "x_m", "y_m", "yaw_rad", "verdict"};

double number(const YAML::Node& entry, const char* key, const std::string& where) {
  try {
    const double value = entry[key].as<double>();
    if (std::isfinite(value)) return value;
  } catch (const YAML::Exception&) {
  }
  throw UserError(fmt::format("{}: '{}' must be a number.", where, key));
}

ListedClosure read_entry(const YAML::Node& entry, const std::string& where) {
  if (!entry.IsMap()) throw UserError(where + ": must be a map with from_stamp_s, to_stamp_s and verdict.");
  for (const auto& pair : entry) {
    const auto key = pair.first.as<std::string>();
    if (std::find(std::begin(kKeys), std::end(kKeys), key) == std::end(kKeys)) {
      throw UserError(fmt::format("{}: '{}' is no key of a closure.", where, key));
    }
  }
  ListedClosure line;
  line.where = where;
  line.from_stamp_s = number(entry, "from_stamp_s", where);
  line.to_stamp_s = number(entry, "to_stamp_s", where);
  if (entry["drives"]) {
    try {
      const auto drives = entry["drives"].as<std::vector<int>>();
      if (drives.size() != 2) throw YAML::Exception(entry["drives"].Mark(), "");
      line.from_drive = drives[0];
      line.to_drive = drives[1];
    } catch (const YAML::Exception&) {
      throw UserError(where + ": 'drives' must be two drive numbers, from 0.");
    }
  }
  line.has_transform = entry["x_m"] && entry["y_m"] && entry["yaw_rad"];
  if (line.has_transform) {
    line.T_from_to = {number(entry, "x_m", where), number(entry, "y_m", where),
                      number(entry, "yaw_rad", where)};
  }
  return line;
}

}  // namespace

std::vector<ListedClosure> read_closure_list(const std::string& path) {
  const YAML::Node file = load_yaml_file(path);
  if (!file.IsMap() || !file["closures"] || file.size() != 1 ||
      !(file["closures"].IsSequence() || file["closures"].IsNull())) {
    throw UserError(path + ": must hold one list, 'closures', as the closures.yaml beside a map.");
  }
  std::vector<ListedClosure> out;
  for (std::size_t i = 0; i < file["closures"].size(); ++i) {
    const YAML::Node entry = file["closures"][i];
    const std::string where = fmt::format("{}: closure {}", path, i + 1);
    ListedClosure line = read_entry(entry, where);
    const auto verdict = entry["verdict"] ? entry["verdict"].as<std::string>("") : "auto";
    if (verdict == "auto") continue;
    if (verdict != "allow" && verdict != "deny") {
      throw UserError(fmt::format("{}: verdict '{}' must be auto, allow or deny.", where, verdict));
    }
    line.allow = verdict == "allow";
    if (line.allow && !line.has_transform)
      throw UserError(where + ": to allow it, x_m, y_m and yaw_rad are needed.");
    out.push_back(line);
  }
  return out;
}

void write_closure_list(const std::string& path, const MapRecord& record) {
  std::string text = kHead;
  for (const Closure& c : record.closures) {
    text += fmt::format(
        "  - {{drives: [{}, {}], from_stamp_s: {:.6f}, to_stamp_s: {:.6f}, x_m: {:.4f}, y_m: {:.4f}, "
        "yaw_rad: {:.5f}, verdict: {}}}  # {}, {}\n",
        record.drive_of(c.from), record.drive_of(c.to), record.keyframe(c.from).stamp_s,
        record.keyframe(c.to).stamp_s, c.match.T_from_to.x_m, c.match.T_from_to.y_m,
        c.match.T_from_to.yaw_rad, c.verdict.empty() ? "auto" : c.verdict, c.source,
        c.accepted ? "accepted" : "refused: " + c.reason);
  }
  if (record.closures.empty()) text += "  []\n";
  write_text_atomically(path, text);
}

}  // namespace knav
