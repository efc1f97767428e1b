// evaluate_trajectory: how far a trajectory is from verified relations or from a reference.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "ros_common/command_line.h"
#include "tools/trajectory_metrics.h"

namespace knav {
namespace {

constexpr double kShortSpan_s = 20.0;
constexpr double kSegmentLengths_m[] = {5.0, 10.0, 20.0, 50.0};

const char* const kJsonHelp =
    R"(The JSON holds
  relations.all, relations.under_20_s: count, translation_mean_m, translation_sd_m, rotation_mean_deg,
      rotation_sd_deg (only with --relations)
  segments."5", "10", "20", "50" (metres of path): count, translation_mean_m, rotation_mean_deg (only with --reference)
  ate_rmse_m, ate_count: after the best rigid alignment (only with --reference))";

nlohmann::json to_json(const ErrorStatistics& e, bool with_sd) {
  nlohmann::json json = {{"count", e.count},
                         {"translation_mean_m", e.translation_mean_m},
                         {"rotation_mean_deg", e.rotation_mean_deg}};
  if (with_sd) {
    json["translation_sd_m"] = e.translation_sd_m;
    json["rotation_sd_deg"] = e.rotation_sd_deg;
  }
  return json;
}

void print_row(const std::string& name, const ErrorStatistics& e) {
  fmt::print("{:<28} {:>6}   {:.4f} +- {:.4f} m   {:.3f} +- {:.3f} deg\n", name, e.count, e.translation_mean_m,
             e.translation_sd_m, e.rotation_mean_deg, e.rotation_sd_deg);
}

void evaluate(const std::string& trajectory_path, const std::string& relations_path,
              const std::string& reference_path, const std::string& json_path) {
  const Trajectory estimate = read_trajectory(trajectory_path);
  if (estimate.empty()) throw UserError(trajectory_path + ": holds no poses.");
  nlohmann::json json;
  int compared = 0;
  if (!relations_path.empty()) {
    const auto relations = read_relations(relations_path);
    const auto all = relation_error(estimate, relations, 0.0);
    const auto under = relation_error(estimate, relations, kShortSpan_s);
    json["relations"] = {{"all", to_json(all, true)}, {"under_20_s", to_json(under, true)}};
    print_row("relations, all", all);
    print_row("relations under 20 s apart", under);
    compared += all.count;
  }
  if (!reference_path.empty()) {
    const Trajectory reference = read_trajectory(reference_path);
    for (const double length_m : kSegmentLengths_m) {
      const auto error = segment_error(estimate, reference, length_m);
      json["segments"][fmt::format("{:.0f}", length_m)] = to_json(error, false);
      print_row(fmt::format("segments of {:.0f} m", length_m), error);
    }
    int matched = 0;
    const double ate_m = absolute_trajectory_error_m(estimate, reference, &matched);
    json["ate_rmse_m"] = ate_m;
    json["ate_count"] = matched;
    fmt::print("{:<28} {:>6}   {:.4f} m rmse\n", "absolute, after alignment", matched, ate_m);
    compared += matched;
  }
  if (compared == 0) {
    throw UserError(trajectory_path + ": shares no stamps with what it is compared to; are they of one recording?");
  }
  write_json(json_path, json.dump(2));
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app("Translational [m] and rotational [deg] error of a trajectory, as Kuemmerle et al. 2009.");
  std::string trajectory, relations, reference, json;
  app.add_option("TRAJECTORY", trajectory, "TUM text: t x y z qx qy qz qw")->required();
  auto* const r = app.add_option("--relations", relations, "verified relations: t1 t2 x y z roll pitch yaw a line");
  auto* const t = app.add_option("--reference", reference, "reference trajectory: TUM text, or t x y theta a line");
  app.add_option("--json", json, "write the figures to this file; '-' for standard output");
  app.footer(knav::kJsonHelp);
  app.callback([&] {
    if (r->empty() && t->empty()) throw CLI::ValidationError("give --relations F, --reference F, or both");
  });
  return knav::run_command(app, argc, argv, [&] { knav::evaluate(trajectory, relations, reference, json); });
}
