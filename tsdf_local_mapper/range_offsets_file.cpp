#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "tsdf_local_mapper/range_errors.h"

namespace knav {

RangeOffsets RangeOffsets::load(const std::string& path) {
  const YAML::Node file = load_yaml_file(path);
  RangeOffsets offsets;
  try {
    offsets.offset_per_m = file["offset_per_m"].as<std::vector<double>>();
    offsets.sd_per_m = file["sd_per_m"].as<std::vector<double>>();
  } catch (const std::exception&) {
    throw UserError(path + ": no file of a depth camera's learned errors ('offset_per_m' and 'sd_per_m'); delete it.");
  }
  bool sound = offsets.offset_per_m.size() >= 2 && offsets.offset_per_m.size() == offsets.sd_per_m.size();
  for (const double v : offsets.offset_per_m) sound = sound && std::fabs(v) < 0.1;
  for (const double v : offsets.sd_per_m) sound = sound && v > 0.0 && v < 1.0;
  if (!sound) throw UserError(path + ": the learned errors make no sense (as many offsets as deviations, in 1/m); delete it.");
  return offsets;
}

void RangeOffsets::save(const std::string& path) const {
  write_text_atomically(path,
                        fmt::format("# What kinect_nav's local mapper learned of its depth camera: per band of columns, left to\n"
                                    "# right, 1 / true depth = 1 / measured depth + offset. Delete this file to start anew.\n"
                                    "offset_per_m: [{:.7f}]\nsd_per_m: [{:.7f}]\n",
                                    fmt::join(offset_per_m, ", "), fmt::join(sd_per_m, ", ")));
}

}  // namespace knav
