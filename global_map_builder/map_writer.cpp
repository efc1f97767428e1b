#include "global_map_builder/map_writer.h"

#include <fmt/format.h>
#include <tbb/parallel_invoke.h>

#include <cmath>
#include <utility>
#include <vector>

#include "core/file_io.h"
#include "global_map_builder/closure_list.h"
#include "global_map_builder/map_picture.h"
#include "global_map_builder/map_report.h"

namespace knav {
namespace {

using Json = nlohmann::json;

Json closures_json(const MapRecord& record) {
  Json list = Json::array();
  for (const Closure& c : record.closures) {
    list.push_back({{"from_drive", record.drive_of(c.from)},
                    {"to_drive", record.drive_of(c.to)},
                    {"from_stamp_s", record.keyframe(c.from).stamp_s},
                    {"to_stamp_s", record.keyframe(c.to).stamp_s},
                    {"from", c.from},
                    {"to", c.to},
                    {"source", c.source},
                    {"verdict", c.verdict},
                    {"matched", c.matched},
                    {"accepted", c.accepted},
                    {"reason", c.reason},
                    {"x_m", c.match.T_from_to.x_m},
                    {"y_m", c.match.T_from_to.y_m},
                    {"yaw_rad", c.match.T_from_to.yaw_rad},
                    {"score", c.match.score},
                    {"overlap", c.match.overlap},
                    {"agreement", c.match.agreement},
                    {"residual_m", c.match.residual_m},
                    {"rival", c.match.rival},
                    {"chi2", c.chi2}});
  }
  return list;
}

Json changes_json(const std::vector<MapChange>& changes) {
  Json list = Json::array();
  for (const MapChange& c : changes) {
    list.push_back({{"now", c.occupied ? "occupied" : "free"},
                    {"x_m", c.x_m},
                    {"y_m", c.y_m},
                    {"width_m", c.width_m},
                    {"height_m", c.height_m},
                    {"wall_m", c.wall_m}});
  }
  return list;
}

std::vector<std::pair<std::string, std::string>> report_figures(const Json& json) {
  std::vector<std::pair<std::string, std::string>> out;
  const auto text = [](const Json& v) {
    return v.is_number_float() ? fmt::format("{:.3g}", v.get<double>())
           : v.is_string()     ? v.get<std::string>()
                               : v.dump();
  };
  for (const auto& [name, value] : json.items()) {
    if (!value.is_object()) {
      out.emplace_back(name, text(value));
      continue;
    }
    std::string parts;
    for (const auto& [key, part] : value.items())
      parts += (parts.empty() ? "" : ", ") + key + " " + text(part);
    out.emplace_back(name, parts);
  }
  return out;
}

std::string names_of(const MapRecord& record) {
  std::vector<std::string> names;
  for (const Drive& drive : record.drives) names.push_back(drive.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

Json figures_of(const BuiltMap& built) {
  const MapRecord& record = built.record;
  std::size_t accepted = 0, frames = 0;
  std::map<std::string, std::size_t> by_source = {
      {"button", 0}, {"automatic", 0}, {"located", 0}, {"list", 0}};
  for (const Closure& c : record.closures) {
    accepted += c.accepted;
    by_source[c.source] += c.accepted;
  }
  double contour_m = 0.0, path_m = 0.0;
  int breaks = 0;
  for (const ContourSegment& s : built.contour) contour_m += std::hypot(s.a.x_m - s.b.x_m, s.a.y_m - s.b.y_m);
  for (const Drive& drive : record.drives) {
    path_m += drive.keyframes.back().path_m;
    frames += drive.frames.size();
    breaks += drive.breaks;
  }
  Json closures = {{"found", record.closures.size()}, {"accepted", accepted}};
  for (const auto& [source, count] : by_source) closures[source] = count;
  const GridGeometry& g = built.map.occupancy.geometry;
  Json json = {{"frames_used", frames},
               {"drives", record.drives.size()},
               {"path_m", path_m},
               {"keyframes", record.T_map_keyframe.size()},
               {"breaks", breaks},
               {"mended_steps", built.mended_steps},
               {"settled_keyframes", built.settled_keyframes},
               {"fitted_pairs", built.fitted_pairs},
               {"closures", closures},
               {"graph", {{"chi2", chi2(built.graph)}, {"edges", built.graph.edges.size()}}},
               {"map",
                {{"width_m", g.width_cells * g.resolution_m},
                 {"height_m", g.height_cells * g.resolution_m},
                 {"contour_m", contour_m}}}};
  if (built.old_drives > 0) json["changes"] = built.changes.size();
  return json;
}

void write_built_map(const std::string& directory, const Json& figures, bool force, BuiltMap* built) {
  const std::string names = names_of(built->record);
  auto& about = built->map.about;
  about["bags"] = names;
  about["path_m"] = fmt::format("{:.1f}", figures.value("path_m", 0.0));
  if (figures.contains("source")) about["source"] = figures["source"].get<std::string>();
  if (figures.contains("seed")) about["seed"] = figures["seed"].dump();
  if (figures.contains("closures")) about["closures_accepted"] = figures["closures"]["accepted"].dump();
  built->map.checksum = save_map(directory, built->map, force, [&](const std::string& folder) {
    write_pose_graph(folder + "/graph.g2o", built->graph);
    write_text_atomically(folder + "/closures.json", closures_json(built->record).dump(1) + "\n");
    write_closure_list(folder + "/closures.yaml", built->record);
    if (built->old_drives > 0) {
      write_text_atomically(folder + "/changes.json", changes_json(built->changes).dump(1) + "\n");
    }
    const auto write_pictures = [&] {
      write_map_picture(folder + "/map.png", *built);
      write_map_report(folder + "/report.html", *built, "Map of " + names, report_figures(figures));
    };
    tbb::parallel_invoke(write_pictures, [&] { write_map_record(folder + "/drives.bin", built->record); });
  });
}

}  // namespace knav
