#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/grid_geometry.h"
#include "global_map_builder/corrected_drive.h"
#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/range_offset.h"

namespace knav {

/// The drives' corrected poses.
/// @param poses T_map_keyframe of all drives' keyframes, one after the other
std::vector<CorrectedDrive> corrected_drives(const std::vector<Drive>& drives,
                                             const std::vector<Pose2>& poses);

/// The grid that holds all that was seen. UserError if it would be larger than size_max_m.
GridGeometry surface_extent(const MapBuilderConfig& config, const std::vector<Drive>& drives,
                            const std::vector<CorrectedDrive>& corrected);

struct MapSurface {
  std::vector<float> value_m;          ///< signed distance a cell, NaN unknown
  std::vector<std::uint8_t> measured;  ///< where readings ended, see DenseTsdf
};

/// One surface of all drives, the newer correcting the older.
/// @param offset one a drive, taken out of its depths
/// @param report called with the fraction done; may throw to stop
MapSurface build_surface(const MapBuilderConfig& config, const std::vector<Drive>& drives,
                         const std::vector<CorrectedDrive>& corrected, const std::vector<RangeOffset>& offset,
                         const GridGeometry& geometry, const std::function<void(double)>& report);

/// What the map would be without closures: coarse, for a picture.
OccupancyGrid uncorrected_map(const MapBuilderConfig& config, const std::vector<Drive>& drives,
                              const std::vector<CorrectedDrive>& corrected);

}  // namespace knav
