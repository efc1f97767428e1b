#include "brin_benchmark/goal_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "core/error.h"

namespace knav {
namespace {

double ratio(double a, double b) { return b > 0.0 ? a / b : 0.0; }

Honesty honesty_from_json(const nlohmann::json& json) {
  return {json.at("time_s"), json.at("ok_s"), json.at("uncertain_s"), json.at("lost_s"), json.at("initializing_s"), json.at("ok_wrong_s")};
}

nlohmann::json to_json(const GoalResult& r) {
  return {{"goal", to_json(std::vector<SuiteRun>{{"", "", {r.goal}}})[0]["goals"][0]},
          {"right", r.right()},
          {"reached", r.reached},
          {"failure_code", r.failure_code},
          {"reason", r.reason},
          {"reason_off_m", r.reason_off_m},
          {"time_s", r.time_s},
          {"came_near_s", r.came_near_s},
          {"distance_m", r.distance_m},
          {"standing_s", r.standing_s},
          {"localization", to_json(r.localization)},
          {"carried_off", r.carried_off},
          {"noticed_s", r.recovery.noticed_s},
          {"right_s", r.recovery.right_s},
          {"ok_wrong_s", r.recovery.ok_wrong_s},
          {"estimate_off_m", r.estimate_off_m},
          {"true_off_m", r.true_off_m},
          {"turned_round", r.turned_round},
          {"sways", r.sways},
          {"collisions", r.collisions},
          {"walker_contacts", r.walker_contacts},
          {"moved_after_mps", r.moved_after_mps}};
}

GoalResult goal_from_json(const nlohmann::json& json, const std::string& file) {
  GoalResult r;
  const nlohmann::json run = {{{"name", ""}, {"changes", ""}, {"goals", {json.at("goal")}}}};
  r.goal = suite_from_json(run, file)[0].goals[0];
  r.reached = json.at("reached");
  r.failure_code = json.at("failure_code");
  r.reason = json.at("reason");
  r.reason_off_m = json.at("reason_off_m");
  r.time_s = json.at("time_s");
  r.came_near_s = json.value("came_near_s", -1.0);
  r.distance_m = json.at("distance_m");
  r.standing_s = json.at("standing_s");
  r.localization = honesty_from_json(json.at("localization"));
  r.carried_off = json.at("carried_off");
  r.recovery.noticed_s = json.at("noticed_s");
  r.recovery.right_s = json.at("right_s");
  r.recovery.ok_wrong_s = json.at("ok_wrong_s");
  r.estimate_off_m = json.at("estimate_off_m");
  r.true_off_m = json.at("true_off_m");
  r.turned_round = json.at("turned_round");
  r.sways = json.at("sways");
  r.collisions = json.at("collisions");
  r.walker_contacts = json.at("walker_contacts");
  r.moved_after_mps = json.at("moved_after_mps");
  return r;
}

std::string row(const char* what, const char* asked, const std::string& measured) {
  return fmt::format("| {} | {} | {} |\n", what, asked, measured);
}

}  // namespace

GoalScore score(const std::vector<GoalRunResult>& runs) {
  GoalScore s;
  double standing_s = 0.0, driving_s = 0.0, run_s = 0.0, frame_s = 0.0, plans = 0.0;
  int arrivals = 0;
  for (const GoalRunResult& run : runs) {
    driving_s += run.driving_s;
    plans += run.plans;
    run_s += run.time_s;
    frame_s += run.time_s * run.frame_cost_ms;
    s.control_max_ms = std::max(s.control_max_ms, run.control_max_ms);
    for (const GoalResult& r : run.goals) {
      s.collisions += r.collisions;
      s.walker_contacts += r.walker_contacts;
      s.moved_after_mps = std::max(s.moved_after_mps, r.moved_after_mps);
      if (r.reached) {
        ++arrivals;
        s.estimate_off_max_m = std::max(s.estimate_off_max_m, r.estimate_off_m);
        s.true_off_max_m = std::max(s.true_off_max_m, r.true_off_m);
        s.estimate_off_mean_m += r.estimate_off_m;
        s.true_off_mean_m += r.true_off_m;
      }
      s.localization.add(r.localization);
      if (r.carried_off) {
        ++s.carried_off;
        s.noticed += r.recovery.noticed() ? 1 : 0;
        s.localized_again += r.recovery.right() ? 1 : 0;
      }
      if (r.goal.kidnap) {
        ++s.kidnapped;
        s.found_again += r.reached ? 1 : 0;
        continue;
      }
      ++s.goals;
      if (r.goal.expected != Expected::kReached) {
        ++s.unreachable;
        s.right += r.right() ? 1 : 0;
        s.right_in_time += r.right() && r.time_s <= kGiveUpWithin_s ? 1 : 0;
        if (r.right()) s.given_up_max_s = std::max(s.given_up_max_s, r.time_s);
        if (r.right() && r.came_near_s >= 0.0) s.given_up_after_near_max_s = std::max(s.given_up_after_near_max_s, r.time_s - r.came_near_s);
        continue;
      }
      ++s.reachable;
      s.turned_round += r.turned_round;
      s.sways += r.sways;
      s.time_s += r.time_s;
      if (!r.reached) continue;
      ++s.reached;
      s.distance_m += r.distance_m;
      standing_s += r.standing_s;
    }
  }
  // Turning round counts over all the time there was, speed over the goals that were reached.
  s.reversals_per_20s = 20.0 * ratio(s.turned_round + s.sways, s.time_s);
  double reached_s = 0.0;
  for (const GoalRunResult& run : runs) {
    for (const GoalResult& r : run.goals) {
      if (r.reached && !r.goal.kidnap && r.goal.expected == Expected::kReached) reached_s += r.time_s;
    }
  }
  s.time_s = reached_s;
  s.speed_mps = ratio(s.distance_m, s.time_s);
  s.moving_speed_mps = ratio(s.distance_m, s.time_s - standing_s);
  s.estimate_off_mean_m = ratio(s.estimate_off_mean_m, arrivals);
  s.true_off_mean_m = ratio(s.true_off_mean_m, arrivals);
  s.plans_per_s = ratio(plans, driving_s);
  s.frame_cost_ms = ratio(frame_s, run_s);
  return s;
}

nlohmann::json to_json(const GoalScore& s) {
  return {{"goals", s.goals},
          {"reachable", s.reachable},
          {"reached", s.reached},
          {"unreachable", s.unreachable},
          {"right_reason", s.right},
          {"right_reason_in_time", s.right_in_time},
          {"given_up_max_s", s.given_up_max_s},
          {"given_up_after_near_max_s", s.given_up_after_near_max_s},
          {"kidnapped", s.kidnapped},
          {"found_again", s.found_again},
          {"carried_off", s.carried_off},
          {"noticed", s.noticed},
          {"localized_again", s.localized_again},
          {"localization", to_json(s.localization)},
          {"collisions", s.collisions},
          {"walker_contacts", s.walker_contacts},
          {"time_s", s.time_s},
          {"distance_m", s.distance_m},
          {"speed_mps", s.speed_mps},
          {"moving_speed_mps", s.moving_speed_mps},
          {"turned_round", s.turned_round},
          {"sways", s.sways},
          {"reversals_per_20s", s.reversals_per_20s},
          {"estimate_off_mean_m", s.estimate_off_mean_m},
          {"estimate_off_max_m", s.estimate_off_max_m},
          {"true_off_mean_m", s.true_off_mean_m},
          {"true_off_max_m", s.true_off_max_m},
          {"moved_after_mps", s.moved_after_mps},
          {"plans_per_s", s.plans_per_s},
          {"control_max_ms", s.control_max_ms},
          {"frame_cost_ms", s.frame_cost_ms}};
}

nlohmann::json to_json(const GoalRunResult& run) {
  nlohmann::json goals = nlohmann::json::array();
  for (const GoalResult& r : run.goals) goals.push_back(to_json(r));
  return {{"name", run.name},           {"time_s", run.time_s},
          {"distance_m", run.distance_m}, {"wall_s", run.wall_s},
          {"frame_cost_ms", run.frame_cost_ms}, {"driving_s", run.driving_s},
          {"plans", run.plans},         {"control_max_ms", run.control_max_ms},
          {"goals", goals}};
}

GoalRunResult goal_run_from_json(const nlohmann::json& json, const std::string& file) {
  GoalRunResult run;
  try {
    run.name = json.at("name");
    run.time_s = json.at("time_s");
    run.distance_m = json.at("distance_m");
    run.wall_s = json.at("wall_s");
    run.frame_cost_ms = json.at("frame_cost_ms");
    run.driving_s = json.at("driving_s");
    run.plans = json.at("plans");
    run.control_max_ms = json.at("control_max_ms");
    for (const auto& goal : json.at("goals")) run.goals.push_back(goal_from_json(goal, file));
  } catch (const nlohmann::json::exception& error) {
    throw UserError(file + ": is not a run's result: " + error.what());
  }
  return run;
}

std::string goal_report_markdown(const std::vector<GoalRunResult>& runs, const std::vector<std::string>& about) {
  const GoalScore s = score(runs);
  std::string text = "# Goals\n\n";
  for (const std::string& line : about) text += "- " + line + "\n";
  text += "\n| | asked | measured |\n|---|---|---|\n";
  text += row("collisions", "0", fmt::format("{}", s.collisions));
  text += row("people who walked into the robot", "counted", fmt::format("{}", s.walker_contacts));
  text += row("reachable goals reached", ">= 99 %", fmt::format("{} of {} ({:.1f} %)", s.reached, s.reachable, 100.0 * ratio(s.reached, s.reachable)));
  text += row("unreachable ones given up with the right reason, within 60 s", "all",
              fmt::format("{} of {}, {} within 60 s (longest {:.0f} s; {:.0f} s since it came within {:.0f} m of the closed door)", s.right, s.unreachable,
                          s.right_in_time, s.given_up_max_s, s.given_up_after_near_max_s, kNearClosedDoor_m));
  text += row("mean speed, from goal to arrival", ">= 0.45 m/s", fmt::format("{:.3f} m/s ({:.3f} while not standing), {:.0f} m", s.speed_mps, s.moving_speed_mps, s.distance_m));
  text += row("from the goal, by the localizer", "<= 0.05 m", fmt::format("mean {:.3f}, max {:.3f} m", s.estimate_off_mean_m, s.estimate_off_max_m));
  text += row("from the goal, in truth (with the map's own errors)", "", fmt::format("mean {:.3f}, max {:.3f} m", s.true_off_mean_m, s.true_off_max_m));
  text += row("reversals in 20 s of driving", "<= 1", fmt::format("{:.2f} ({} turned round, {} swayed)", s.reversals_per_20s, s.turned_round, s.sways));
  text += row("cmd_vel in the second after the end", "0", fmt::format("{:.3f}", s.moved_after_mps));
  text += row("kidnapped on the way, arrived all the same", ">= 18 of 20", fmt::format("{} of {}", s.found_again, s.kidnapped));
  text += row("carried off, not ok within 5 s", ">= 95 %", fmt::format("{} of {}", s.noticed, s.carried_off));
  text += row("carried off, localized again (0.3 m, 5 deg) within 40 s", ">= 90 %", fmt::format("{} of {}", s.localized_again, s.carried_off));
  text += row("ok while more than 0.5 m off, without 5 s after being carried off", "< 0.1 %",
              fmt::format("{:.3f} %, {:.1f} of {:.0f} s", 100.0 * ratio(s.localization.ok_wrong_s, s.localization.time_s), s.localization.ok_wrong_s, s.localization.time_s));
  text += row("plans a second while driving", ">= 5", fmt::format("{:.2f}", s.plans_per_s));
  text += row("the robot's work, a frame; longest control step", "", fmt::format("{:.1f} ms; {:.0f} ms", s.frame_cost_ms, s.control_max_ms));

  std::map<std::string, std::pair<int, int>> kinds;  // right, all
  for (const GoalRunResult& run : runs) {
    for (const GoalResult& r : run.goals) {
      auto& count = kinds[r.goal.kidnap ? "kidnapped" : r.goal.kind];
      count.first += r.right() ? 1 : 0;
      ++count.second;
    }
  }
  text += "\n| goals | as they should end |\n|---|---|\n";
  for (const auto& [kind, count] : kinds) text += fmt::format("| {} | {} of {} |\n", kind, count.first, count.second);

  text += "\n| run | goals | right | collisions | speed | reversals in 20 s | cost a frame |\n|---|---|---|---|---|---|---|\n";
  for (const GoalRunResult& run : runs) {
    const GoalScore one = score({run});
    text += fmt::format("| {} | {} | {} | {} | {:.2f} m/s | {:.2f} | {:.1f} ms |\n", run.name, run.goals.size(),
                        one.reached + one.right + one.found_again, one.collisions, one.speed_mps, one.reversals_per_20s, run.frame_cost_ms);
  }
  bool heading = false;
  for (const GoalRunResult& run : runs) {
    for (std::size_t i = 0; i < run.goals.size(); ++i) {
      const GoalResult& r = run.goals[i];
      const bool late = r.goal.expected != Expected::kReached && r.time_s > kGiveUpWithin_s;
      if (r.right() && !late && r.collisions == 0) continue;
      if (!heading) text += "\nNot as they should be:\n\n";
      heading = true;
      text += fmt::format("- {}, goal {} ({}{}), after {:.0f} s and {:.0f} m{}{}: {}\n", run.name, i + 1, r.goal.kind,
                          r.goal.kidnap ? ", kidnapped" : "", r.time_s, r.distance_m,
                          r.collisions > 0 ? ", ran into something" : "", r.localization.lost_s > 1.0 ? fmt::format(", {:.0f} s lost", r.localization.lost_s) : "",
                          r.reached ? "reached." : r.reason);
    }
  }
  return text;
}

}  // namespace knav
