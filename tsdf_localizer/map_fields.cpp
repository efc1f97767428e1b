#include "tsdf_localizer/map_fields.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"

namespace knav {
namespace {

constexpr double kCoarseCell_m = 0.2;

double price(float distance_m, double truncation_m, double unknown_cost) {
  return std::isfinite(distance_m) ? std::min(1.0, std::fabs(distance_m) / truncation_m) : unknown_cost;
}

PriceField fine_field(const DistanceMap& map, const MeasurementConfig& config) {
  std::vector<std::uint8_t> prices(map.distance_m.size());
  const auto to_price = static_cast<float>(255.0 / config.truncation_m);
  const std::uint8_t unknown = quantized_price(config.unknown_cost);
  for (std::size_t i = 0; i < prices.size(); ++i) {
    const float price = std::fabs(map.distance_m[i]) * to_price;  // NaN where unknown
    prices[i] = price >= 0.0f ? static_cast<std::uint8_t>(std::min(255.0f, price + 0.5f)) : unknown;
  }
  return {map.geometry, prices, unknown};
}

PriceField coarse_field(const DistanceMap& map, double truncation_m, double unknown_cost) {
  const GridGeometry& fine = map.geometry;
  const int factor = std::max(1, static_cast<int>(std::lround(kCoarseCell_m / fine.resolution_m)));
  GridGeometry coarse = fine;
  coarse.resolution_m = fine.resolution_m * factor;
  coarse.width_cells = (fine.width_cells + factor - 1) / factor;
  coarse.height_cells = (fine.height_cells + factor - 1) / factor;
  std::vector<std::uint8_t> prices(coarse.cell_count());
  for (int iy = 0; iy < coarse.height_cells; ++iy) {
    for (int ix = 0; ix < coarse.width_cells; ++ix) {
      prices[coarse.index(ix, iy)] = quantized_price(price(map.at(ix * factor + factor / 2, iy * factor + factor / 2), truncation_m, unknown_cost));
    }
  }
  return {coarse, prices, quantized_price(unknown_cost)};
}

std::vector<Point2> free_positions(const DistanceMap& map, const GlobalSearchConfig& config) {
  const GridGeometry& grid = map.geometry;
  std::vector<Point2> positions;
  const int columns =
      std::max(1, static_cast<int>(std::ceil(grid.width_cells * grid.resolution_m / config.step_m)));
  const int rows =
      std::max(1, static_cast<int>(std::ceil(grid.height_cells * grid.resolution_m / config.step_m)));
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const Point2 p{grid.origin_x_m + (column + 0.5) * config.step_m,
                     grid.origin_y_m + (row + 0.5) * config.step_m};
      const float distance_m = map.nearest(p.x_m, p.y_m);
      if (distance_m > config.clearance_m) positions.push_back(p);  // false for NaN: unknown is never free
    }
  }
  return positions;
}

}  // namespace

bool shows_the_same(const DistanceMap& map, const OccupancyGrid& occupancy) {
  constexpr std::int8_t kOccupied = 65;   // map_server's threshold
  constexpr double kAgreeing = 0.95;
  const GridGeometry &a = map.geometry, &b = occupancy.geometry;
  const double tolerance_m = 0.01 * a.resolution_m;
  if (a.width_cells != b.width_cells || a.height_cells != b.height_cells || occupancy.value.size() != map.distance_m.size() ||
      !(std::fabs(a.resolution_m - b.resolution_m) < 1e-6) || !(std::fabs(a.origin_x_m - b.origin_x_m) < tolerance_m) ||
      !(std::fabs(a.origin_y_m - b.origin_y_m) < tolerance_m))
    return false;
  std::size_t walls = 0, agreeing = 0;
  for (std::size_t i = 0; i < occupancy.value.size(); ++i) {
    if (occupancy.value[i] < kOccupied) continue;
    ++walls;
    agreeing += map.distance_m[i] < 1.5 * a.resolution_m;  // negative behind a surface; false for NaN
  }
  return static_cast<double>(agreeing) >= kAgreeing * static_cast<double>(walls);
}

MapFields make_map_fields(const DistanceMap& map, const MeasurementConfig& measurement,
                          const GlobalSearchConfig& search) {
  const GridGeometry& grid = map.geometry;
  if (grid.width_cells <= 0 || grid.height_cells <= 0 || !(grid.resolution_m > 0.0)) {
    throw UserError("map: it has no cells, or a resolution that is not above 0; build or load another one.");
  }
  if (map.distance_m.size() != grid.cell_count()) {
    throw UserError("map: the number of its values is not width x height; build or load another one.");
  }
  return {map, fine_field(map, measurement), coarse_field(map, search.truncation_m, measurement.unknown_cost),
          free_positions(map, search)};
}

}  // namespace knav
