#pragma once

#include <string>
#include <vector>

#include "global_map_builder/map_builder.h"

namespace knav {

/// A PNG of the map: black walls, white free, grey unknown; the drive from blue (start) to red (end),
/// accepted closures green, refused ones magenta, with a scale bar of whole metres.
void write_map_picture(const std::string& path, const BuiltMap& built);
/// The same in memory.
std::vector<unsigned char> map_picture(const BuiltMap& built);
/// Without closures, with the drives as the local mapper saw them.
std::vector<unsigned char> before_picture(const BuiltMap& built);
/// The map with what came in red and what went in blue.
std::vector<unsigned char> changes_picture(const BuiltMap& built);
/// Two visits' walls on each other, 180 pixels wide.
std::vector<unsigned char> closure_thumbnail(const Closure& closure);

/// The grid alone.
void write_map_picture(const std::string& path, const MapDirectory& map);

}  // namespace knav
