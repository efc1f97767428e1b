#include "core/config_sections.h"

#include <algorithm>

#include "core/config.h"
#include "core/error.h"

namespace knav {

const std::vector<std::string>& config_section_names() {
  static const std::vector<std::string> names = {
      "openni2_camera", "depth_correction", "calibrate_depth_live", "rolling_shutter", "floor_removal",
      "depth_profile",  "local_mapper",     "live_map_builder",     "mapping_recorder", "map_builder",
      "map_server",     "localizer",        "planner_tracker",      "navigation",       "simulator",
      "tour_driver"};
  return names;
}

void refuse_unknown_sections(const std::string& path) {
  if (path.empty()) return;
  const YAML::Node file = load_yaml_file(path);
  if (!file.IsMap()) throw UserError(path + ": must be a map of sections, one per node.");
  const std::vector<std::string>& names = config_section_names();
  for (const auto& entry : file) {
    const auto name = entry.first.as<std::string>();
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    const std::string meant = nearest_word(name, names);
    throw UserError(path + ": unknown section '" + name + "'" +
                    (meant.empty() ? "; config/default.yaml has them all." : "; did you mean '" + meant + "'?"));
  }
}

}  // namespace knav
