#pragma once

#include <string>
#include <utility>
#include <vector>

#include "global_map_builder/map_builder.h"

namespace knav {

/// One HTML file with its pictures in it: the figures given, the map before and after closing loops with the
/// drives, what changed, and every closure with its figures, its picture, why it was refused, and a choice
/// whose list can be saved for `build_map --closures`. The same map gives the same bytes.
/// @param figures name and text, in order
void write_map_report(const std::string& path, const BuiltMap& built, const std::string& title,
                      const std::vector<std::pair<std::string, std::string>>& figures);

}  // namespace knav
