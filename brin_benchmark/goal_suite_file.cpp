// A suite's words, its file, and the keepout mask that goes with it.
#include <algorithm>

#include "brin_benchmark/goal_suite.h"
#include "core/error.h"

namespace knav {
namespace {

constexpr double kKeepoutRim_m = 0.10;

nlohmann::json pose_json(const Pose2& pose) { return {pose.x_m, pose.y_m, pose.yaw_rad}; }
Pose2 pose_from(const nlohmann::json& json) { return {json.at(0), json.at(1), json.at(2)}; }

Expected expected_from(const std::string& word, const std::string& file) {
  for (const Expected e : {Expected::kReached, Expected::kOccupied, Expected::kUnknown, Expected::kBlocked}) {
    if (word == to_string(e)) return e;
  }
  throw UserError(file + ": '" + word + "' is nothing that can be expected of a goal.");
}

}  // namespace

const char* to_string(Expected expected) {
  switch (expected) {
    case Expected::kReached:
      return "reached";
    case Expected::kOccupied:
      return "occupied";
    case Expected::kUnknown:
      return "unknown";
    case Expected::kBlocked:
      return "blocked";
  }
  return "";
}

bool right_reason(Expected expected, FailureCode code) {
  switch (expected) {
    case Expected::kReached:
      return false;
    case Expected::kOccupied:
      return code == FailureCode::kGoalOccupied || code == FailureCode::kGoalUnknown;
    case Expected::kUnknown:
      return code == FailureCode::kGoalUnknown;
    case Expected::kBlocked:
      return code == FailureCode::kBlocked;
  }
  return false;
}

void paint_keepout(const WorldConfig& world, const WorldInMap& world_in_map, MapDirectory* map) {
  OccupancyGrid& mask = map->keepout;
  mask.geometry = map->occupancy.geometry;
  const GridGeometry& g = mask.geometry;
  if (mask.value.size() != g.cell_count()) mask.value.assign(g.cell_count(), 0);
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      const Point2 p = world_in_map.in_world({g.center_x_m(ix), g.center_y_m(iy)});
      const bool glass = std::any_of(world.solids.begin(), world.solids.end(), [&](const Solid& s) {
        return s.material == Material::kGlass && footprint_distance_m(s, p) < kKeepoutRim_m;
      });
      const bool stairs = std::any_of(world.stairs.begin(), world.stairs.end(), [&](const FloorRect& r) {
        return p.x_m > r.min_x_m - kKeepoutRim_m && p.x_m < r.max_x_m + kKeepoutRim_m && p.y_m > r.min_y_m - kKeepoutRim_m &&
               p.y_m < r.max_y_m + kKeepoutRim_m;
      });
      if (glass || stairs) mask.value[g.index(ix, iy)] = 100;
    }
  }
}

nlohmann::json to_json(const std::vector<SuiteRun>& suite) {
  nlohmann::json runs = nlohmann::json::array();
  for (const SuiteRun& run : suite) {
    nlohmann::json goals = nlohmann::json::array();
    for (const SuiteGoal& goal : run.goals) {
      nlohmann::json entry = {{"kind", goal.kind},
                              {"world_x_y_yaw_m_rad", pose_json(goal.T_world_goal)},
                              {"expected", to_string(goal.expected)}};
      if (goal.expected == Expected::kBlocked) entry["closed_at_m"] = {goal.closed_at.x_m, goal.closed_at.y_m};
      if (goal.kidnap) entry["kidnap_to_x_y_yaw_m_rad"] = pose_json(goal.T_world_kidnap);
      goals.push_back(entry);
    }
    runs.push_back({{"name", run.name}, {"changes", run.changes}, {"goals", goals}});
  }
  return runs;
}

std::vector<SuiteRun> suite_from_json(const nlohmann::json& json, const std::string& file) {
  std::vector<SuiteRun> suite;
  try {
    for (const auto& entry : json) {
      SuiteRun run;
      run.name = entry.at("name");
      run.changes = entry.at("changes");
      for (const auto& g : entry.at("goals")) {
        SuiteGoal goal;
        goal.kind = g.at("kind");
        goal.T_world_goal = pose_from(g.at("world_x_y_yaw_m_rad"));
        goal.expected = expected_from(g.at("expected"), file);
        if (g.contains("closed_at_m")) goal.closed_at = {g.at("closed_at_m").at(0), g.at("closed_at_m").at(1)};
        goal.kidnap = g.contains("kidnap_to_x_y_yaw_m_rad");
        if (goal.kidnap) goal.T_world_kidnap = pose_from(g.at("kidnap_to_x_y_yaw_m_rad"));
        run.goals.push_back(goal);
      }
      suite.push_back(run);
    }
  } catch (const nlohmann::json::exception& error) {
    throw UserError(file + ": is not a suite of goals: " + error.what());
  }
  return suite;
}

}  // namespace knav
