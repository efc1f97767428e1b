#pragma once

#include <vector>

#include "core/distance_map.h"
#include "core/grid_geometry.h"
#include "core/pose2.h"
#include "tsdf_localizer/localizer_config.h"
#include "tsdf_localizer/price_field.h"

namespace knav {

/// What the localizer reads of a map, made once when the map comes.
struct MapFields {
  DistanceMap map;
  PriceField fine;    ///< |distance| / truncation at the map's own resolution, for the filter
  PriceField coarse;  ///< in cells of about 0.2 m and with a wider truncation, small enough for the cache:
                     ///< first search
  std::vector<Point2> search_positions;  ///< free places on the search's grid
};

/// True if an occupancy grid may be that of a distance map: the same cells, and nearly all walls where the distances are small.
bool shows_the_same(const DistanceMap& map, const OccupancyGrid& occupancy);

/// UserError if the map is empty, or its size and data disagree.
MapFields make_map_fields(const DistanceMap& map, const MeasurementConfig& measurement,
                          const GlobalSearchConfig& search);

}  // namespace knav
