#pragma once

#include <string>

#include "global_map_builder/map_builder.h"

namespace knav {

/// A PNG of the map: black walls, white free, grey unknown; the drive from blue (start) to red (end),
/// accepted closures green, refused ones magenta, with a scale bar of whole metres.
void write_map_picture(const std::string& path, const BuiltMap& built);

/// The grid alone.
void write_map_picture(const std::string& path, const MapDirectory& map);

}  // namespace knav
