#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/grid_geometry.h"
#include "core/particle_filter.h"

namespace knav {

/// What a reading costs that ends in a cell: 0 on a surface, 1 far from any, quantised to 1/255. The localizer makes
/// one from its map; alignment_costs() reads it. Each cell's word packs its own value with those of its right, upper
/// and upper right neighbours, so that a bilinear value takes one random read instead of four.
class CostField {
 public:
  CostField() = default;
  /// @param outside_cost in [0, 1], of every point off the grid; also the initial value of all cells
  CostField(const GridGeometry& geometry, double outside_cost);

  const GridGeometry& geometry() const { return geometry_; }
  void set(int ix, int iy, double cost);
  double at(int ix, int iy) const;

  const std::uint32_t* quads() const { return quad_.data(); }
  std::uint8_t outside() const { return outside_; }

 private:
  void put(int ix, int iy, int byte, std::uint8_t value);

  GridGeometry geometry_;
  std::vector<std::uint32_t> quad_;
  std::uint8_t outside_ = 255;
};

/// Readings as points in the robot's frame, with weights (need not sum to 1).
struct WeightedPoints {
  std::vector<float> x_m, y_m, weight;
  std::size_t size() const { return x_m.size(); }
  void clear() {
    x_m.clear();
    y_m.clear();
    weight.clear();
  }
  void add(float x, float y, float w) {
    x_m.push_back(x);
    y_m.push_back(y);
    weight.push_back(w);
  }
};

/// For each particle, the weighted mean cost in [0, 1] of the readings seen from its pose (equation 7, normalised).
/// The same bytes on machines with and without AVX2.
/// @param interpolate bilinear between cell centres; otherwise the nearest cell
/// @param vectors     false: plain code even where there is AVX2, for tests
void alignment_costs(const CostField& field, const WeightedPoints& points_robot, const ParticleSet& particles,
                     bool interpolate, std::vector<float>* cost, bool vectors = true);

}  // namespace knav
