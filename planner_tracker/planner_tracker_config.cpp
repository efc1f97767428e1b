#include "planner_tracker/planner_tracker_config.h"

namespace knav {

Footprint PlannerTrackerConfig::outline() const {
  if (footprint.empty()) return Footprint(robot_radius);
  std::string fault;
  const Footprint polygon = Footprint::from_text(footprint, &fault);
  return fault.empty() ? polygon : Footprint(robot_radius);
}

std::vector<std::string> PlannerTrackerConfig::validate() const {
  std::vector<std::string> faults;
  if (!footprint.empty()) {
    std::string fault;
    Footprint::from_text(footprint, &fault);
    if (!fault.empty()) faults.push_back(fault);
  }
  if (clearance.preferred_m < clearance.hard_m) {
    faults.push_back("clearance/preferred_m must not be smaller than clearance/hard_m.");
  }
  if (clearance.keep > clearance.insist) faults.push_back("clearance/keep must not be larger than clearance/insist.");
  if (clearance.free_threshold >= clearance.occupied_threshold) {
    faults.push_back("clearance/free_threshold must be smaller than clearance/occupied_threshold.");
  }
  if (planner_frequency > controller_frequency) {
    faults.push_back("planner_frequency must not exceed controller_frequency.");
  }
  if (recovery.avoid_max_m < recovery.avoid_min_m) {
    faults.push_back("recovery/avoid_max_m must not be smaller than recovery/avoid_min_m.");
  }
  if (tracking.slow_mps > max_vel_x) faults.push_back("tracking/slow_mps must not exceed max_vel_x.");
  if (tracking.turned_rad >= tracking.turn_first_rad) {
    faults.push_back("tracking/turned_rad must be smaller than tracking/turn_first_rad.");
  }
  if (freshness.scan_s < 1.0 / controller_frequency) {
    faults.push_back("freshness/scan_s must be at least one period of controller_frequency.");
  }
  return faults;
}

}  // namespace knav
