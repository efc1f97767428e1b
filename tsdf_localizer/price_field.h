#pragma once

#include <cstdint>
#include <vector>

#include "core/grid_geometry.h"
#include "core/particle_filter.h"
#include "core/weighted_points.h"

namespace knav {

/// What a reading costs that ends somewhere in the map: 0 on a surface, 1 far from any, in steps of 1/255 at cell centres and
/// bilinear between them, a reading's place taken to 1/64 cell. Each word holds a cell's price and those of its right, upper
/// and upper right neighbours, so that a value takes one random read; a rim of cells that cost what is outside spares the
/// comparison with the map's edges.
class PriceField {
 public:
  PriceField() = default;
  /// @param prices row-major, one a cell
  PriceField(const GridGeometry& geometry, const std::vector<std::uint8_t>& prices, std::uint8_t outside);

  const GridGeometry& geometry() const { return geometry_; }
  /// In [0, 1], at a cell's centre; the outside's off the grid.
  double at(int ix, int iy) const;

  const std::uint32_t* quads() const { return quad_.data(); }
  int width() const { return geometry_.width_cells + 2; }  ///< with the rim
  bool empty() const { return quad_.empty(); }

 private:
  GridGeometry geometry_;
  std::vector<std::uint32_t> quad_;
  std::uint8_t outside_ = 255;
};

std::uint8_t quantized_price(double price);

/// Which code to run; `kBest` is what the processor has. All give the same bytes.
enum class PriceCode { kBest, kPlain, kAvx2, kAvx512 };
bool has(PriceCode code);

/// For each particle, the weighted mean price in [0, 1] of the readings seen from its pose (paper equation 7, normalised).
void mean_prices(const PriceField& field, const WeightedPoints& points_robot, const ParticleSet& particles,
                 std::vector<float>* price, PriceCode code = PriceCode::kBest);

}  // namespace knav
