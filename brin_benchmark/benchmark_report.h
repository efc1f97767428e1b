#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "brin_benchmark/benchmark.h"
#include "brin_benchmark/scoring.h"

namespace knav {

nlohmann::json to_json(const RunResult& run);
/// UserError if a field is missing.
RunResult run_from_json(const nlohmann::json& json, const std::string& file);
nlohmann::json to_json(const Score& score);

/// The tables as Markdown: all runs together beside the paper's, every run, every failure.
/// @param about  lines of how it was made: date, processor, configuration, seeds
std::string report_markdown(const std::vector<RunResult>& runs, const std::vector<std::string>& about);

/// The map with the true path (green), the estimate (red), waypoints, and crosses where legs failed.
void write_run_picture(const std::string& path, const MapDirectory& map,
                       const std::vector<Waypoint>& waypoints, const RunRecord& record);

}  // namespace knav
