#include "tsdf_local_mapper/local_mapper_config.h"

#include <fmt/format.h>

namespace knav {

LocalMapperConfig::LocalMapperConfig() {
  motion.translation_per_translation = 0.05;
  motion.translation_per_rotation = 0.03;
  motion.rotation_per_translation = 0.25;
  motion.rotation_per_rotation = 0.2;
  motion.sideways_per_translation = 0.03;
  motion.translation_floor_m = 0.0003;
  motion.rotation_floor_rad = 0.0001;
}

std::vector<std::string> LocalMapperConfig::validate() const {
  std::vector<std::string> faults;
  const double capacity = tsdf.observation_capacity();
  if (window.max_observations > capacity) {
    faults.push_back(
        fmt::format("window/max_observations: {} frames would overflow a cell's 32-bit sums, which hold "
                    "{:.0f}; lower it, or "
                    "tsdf/weight_bits, or raise tsdf/weight_range_floor_m.",
                    window.max_observations, capacity));
  }
  if (range_min_m >= range_max_m) faults.push_back("range_min_m must be smaller than range_max_m.");
  if (grid_half_size_m < range_max_m + 2.0) {
    faults.push_back(
        fmt::format("grid_half_size_m must be at least range_max_m + 2 m = {} m.", range_max_m + 2.0));
  }
  if (2.0 * grid_half_size_m / tsdf.resolution_m > 16384) {
    faults.push_back(
        "grid_half_size_m / tsdf/resolution_m gives more than 16384 cells a side; enlarge the cells.");
  }
  if (contour.range_max_m > grid_half_size_m)
    faults.push_back("contour/range_max_m must not exceed grid_half_size_m.");
  if (window.parked_observations > window.max_observations) {
    faults.push_back("window/parked_observations must not exceed window/max_observations.");
  }
  if (!ros.range_errors_file.empty() && !range_errors.learn) {
    faults.push_back("ros/range_errors_file is set, but range_errors/learn is off, so that nothing would be read from it or kept.");
  }
  for (const std::string& fault : motion.validate()) faults.push_back("motion: " + fault);
  for (const std::string& fault : tsdf.validate()) faults.push_back("tsdf: " + fault);
  return faults;
}

}  // namespace knav
