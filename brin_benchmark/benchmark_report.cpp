#include "brin_benchmark/benchmark_report.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"

namespace knav {
namespace {

constexpr double kFramesMissed = 0.005;  ///< a share of the depth frames that nobody misses

nlohmann::json to_json(const Estimate& e) {
  return {{"mean", e.mean}, {"low_95", e.low}, {"high_95", e.high}};
}

std::string with_interval(const Estimate& e, int digits) {
  return fmt::format("{:.{}f} [{:.{}f}, {:.{}f}]", e.mean, digits, e.low, digits, e.high, digits);
}

/// The mean over the runs that know, each by its time; nothing if none does.
std::string stage_table(const std::vector<RunResult>& runs) {
  StageTable sum;
  double time_s = 0.0, largest_ms = 0.0;
  for (const RunResult& run : runs) {
    if (run.stage_cost_ms.empty() || (!sum.empty() && run.stage_cost_ms.size() != sum.size())) continue;
    if (sum.empty()) {
      for (const auto& entry : run.stage_cost_ms) sum.emplace_back(entry.first, 0.0);
    }
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i].second += run.time_s * run.stage_cost_ms[i].second;
    time_s += run.time_s;
    largest_ms = std::max(largest_ms, run.frame_cost_ms);
  }
  if (!(time_s > 0.0)) return "";
  std::string text = "\n| the robot's work for a frame, on one core | mean |\n|---|---|\n";
  double whole_ms = 0.0;
  for (const auto& [stage, cost] : sum) {
    text += fmt::format("| {} | {:.2f} ms |\n", stage, cost / time_s);
    whole_ms += cost / time_s;
  }
  return text + fmt::format("| all (largest mean of a run: {:.1f} ms) | {:.1f} ms |\n", largest_ms, whole_ms);
}

}  // namespace

nlohmann::json to_json(const RunResult& run) {
  nlohmann::json legs = nlohmann::json::array();
  for (const Leg& leg : run.legs) {
    nlohmann::json entry = {{"waypoint", leg.waypoint},
                            {"reached", leg.reached},
                            {"time_s", leg.time_s},
                            {"distance_m", leg.distance_m}};
    if (leg.reached) {
      entry["positioning_error_m"] = leg.positioning_error_m;
    } else {
      entry["reason"] = leg.reason;
    }
    legs.push_back(entry);
  }
  nlohmann::json stages = nlohmann::json::array();  // in their order
  for (const auto& [stage, cost_ms] : run.stage_cost_ms) stages.push_back({{"stage", stage}, {"ms", cost_ms}});
  nlohmann::json collisions = nlohmann::json::array();
  for (const Collision& c : run.collisions_at) collisions.push_back({{"time_s", c.time_s}, {"x_m", c.x_m}, {"y_m", c.y_m}});
  return {{"name", run.name},
          {"collisions", run.collisions},
          {"collisions_at", collisions},
          {"walker_contacts", run.walker_contacts},
          {"time_s", run.time_s},
          {"distance_m", run.distance_m},
          {"wall_s", run.wall_s},
          {"frame_cost_ms", run.frame_cost_ms},
          {"stage_cost_ms", stages},
          {"frames_dropped", run.frames_dropped},
          {"legs", legs}};
}

RunResult run_from_json(const nlohmann::json& json, const std::string& file) {
  RunResult run;
  try {
    run.name = json.at("name");
    run.collisions = json.at("collisions");
    for (const auto& c : json.value("collisions_at", nlohmann::json::array())) {
      run.collisions_at.push_back({c.at("time_s"), c.at("x_m"), c.at("y_m")});
    }
    run.walker_contacts = json.at("walker_contacts");
    run.time_s = json.at("time_s");
    run.distance_m = json.at("distance_m");
    run.wall_s = json.at("wall_s");
    run.frame_cost_ms = json.at("frame_cost_ms");
    for (const auto& entry : json.value("stage_cost_ms", nlohmann::json::array())) {
      run.stage_cost_ms.emplace_back(entry.at("stage"), entry.at("ms"));
    }
    run.frames_dropped = json.value("frames_dropped", 0.0);
    for (const auto& entry : json.at("legs")) {
      Leg leg;
      leg.waypoint = entry.at("waypoint");
      leg.reached = entry.at("reached");
      leg.time_s = entry.at("time_s");
      leg.distance_m = entry.at("distance_m");
      if (leg.reached) {
        leg.positioning_error_m = entry.at("positioning_error_m");
      } else {
        leg.reason = entry.at("reason");
      }
      run.legs.push_back(leg);
    }
  } catch (const nlohmann::json::exception& error) {
    throw UserError(file + ": is not a run's result: " + error.what());
  }
  return run;
}

nlohmann::json to_json(const Score& s) {
  return {{"runs", s.runs},
          {"legs", s.legs},
          {"failures", s.failures},
          {"collisions", s.collisions},
          {"walker_contacts", s.walker_contacts},
          {"time_s", s.time_s},
          {"distance_m", s.distance_m},
          {"mean_time_to_failure_s", s.mean_time_to_failure_s},
          {"max_time_to_failure_s", s.max_time_to_failure_s},
          {"mean_distance_to_failure_m", s.mean_distance_to_failure_m},
          {"max_distance_to_failure_m", s.max_distance_to_failure_m},
          {"average_speed_mps", s.average_speed_mps},
          {"positioning_error_mean_m", s.positioning_error_mean_m},
          {"positioning_error_sd_m", s.positioning_error_sd_m},
          {"positioning_error_max_m", s.positioning_error_max_m},
          {"failures_per_run", to_json(s.failures_per_run)},
          {"speed_mps", to_json(s.speed_mps)},
          {"positioning_error_m", to_json(s.positioning_error_m)}};
}

std::string report_markdown(const std::vector<RunResult>& runs, const std::vector<std::string>& about) {
  const Score s = score(runs);
  std::string text = "# Benchmark for Robotic Indoor Navigation\n\n";
  for (const std::string& line : about) text += "- " + line + "\n";
  text += fmt::format(
      "\n| metric | this | paper, MSR-P1 | paper, Pioneer with LIDAR |\n|---|---|---|---|\n"
      "| runs, distance | {}, {:.0f} m | 12, 3000 m | 12, 3000 m |\n"
      "| failures | {} of {} legs | 5 | 9 |\n"
      "| collisions | {} | | |\n"
      "| mean time to failure | {:.0f} s | 2265 s | 726 s |\n"
      "| max time to failure | {:.0f} s | 5023 s | 1971 s |\n"
      "| mean distance to failure | {:.0f} m | 367 m | 183 m |\n"
      "| max distance to failure | {:.0f} m | 860 m | 472 m |\n"
      "| average speed | {:.2f} m/s | 0.16 m/s | 0.25 m/s |\n"
      "| positioning error | {:.3f} +- {:.3f} m (max {:.3f}) | 0.23 +- 0.2 m | 0.22 +- 0.1 m |\n",
      s.runs, s.distance_m, s.failures, s.legs, s.collisions, s.mean_time_to_failure_s,
      s.max_time_to_failure_s, s.mean_distance_to_failure_m, s.max_distance_to_failure_m, s.average_speed_mps,
      s.positioning_error_mean_m, s.positioning_error_sd_m, s.positioning_error_max_m);
  text += fmt::format(
      "\n95 % intervals over runs: failures a run {}, speed {} m/s, positioning error {} m. {} people walked "
      "into the "
      "robot.\n",
      with_interval(s.failures_per_run, 2), with_interval(s.speed_mps, 3),
      with_interval(s.positioning_error_m, 3), s.walker_contacts);
  text +=
      "\n| run | failures | collisions | distance | time | speed | positioning error, mean and max | cost a "
      "frame |\n"
      "|---|---|---|---|---|---|---|---|\n";
  for (const RunResult& run : runs) {
    const Score one = score({run});
    text +=
        fmt::format("| {} | {} | {} | {:.0f} m | {:.0f} s | {:.2f} m/s | {:.3f}, {:.3f} m | {} |\n",
                    run.name, one.failures, one.collisions, one.distance_m, one.time_s, one.average_speed_mps,
                    one.positioning_error_mean_m, one.positioning_error_max_m,
                    run.frame_cost_ms > 0.0 ? fmt::format("{:.1f} ms", run.frame_cost_ms) : "");
  }
  text += stage_table(runs);
  for (const RunResult& run : runs) {
    if (run.frames_dropped <= kFramesMissed) continue;
    text += fmt::format("\n{}: {:.1f} % of the depth frames came too late to be rendered; the machine was too slow.\n",
                        run.name, 100.0 * run.frames_dropped);
  }
  bool heading = false;
  for (const RunResult& run : runs) {
    for (std::size_t i = 0; i < run.legs.size(); ++i) {
      const Leg& leg = run.legs[i];
      if (leg.reached) continue;
      if (!heading) text += "\nFailures:\n\n";
      heading = true;
      text += fmt::format("- {}, leg {} to {}, after {:.0f} s and {:.0f} m: {}\n", run.name, i + 1,
                          leg.waypoint, leg.time_s, leg.distance_m, leg.reason);
    }
  }
  return text;
}

}  // namespace knav
