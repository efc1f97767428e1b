#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "global_map_builder/map_builder.h"

namespace knav {

/// A built map's figures, by the keys that `build_map --help` lists, without those of the run.
nlohmann::json figures_of(const BuiltMap& built);

/// Everything of a built map into a directory, whole or not at all (see save_map): the map, graph.g2o,
/// closures.json, closures.yaml, drives.bin, changes.json, map.png and report.html with `figures`.
/// Sets the map's `about` and checksum.
void write_built_map(const std::string& directory, const nlohmann::json& figures, bool force,
                     BuiltMap* built);

}  // namespace knav
