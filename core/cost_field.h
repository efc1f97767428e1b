#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/grid_geometry.h"
#include "core/particle_filter.h"

namespace knav {

/// What a reading costs that ends in a cell: 0 on a surface, 1 far from any, quantised to 1/255. Mapper and
/// localizer build one from their map; alignment_costs() reads it, one random byte (or four) a reading.
class CostField {
 public:
  CostField() = default;
  /// @param outside_cost in [0, 1], of every point off the grid; also the initial value of all cells
  CostField(const GridGeometry& geometry, double outside_cost);

  const GridGeometry& geometry() const { return geometry_; }
  void set_geometry_origin(double origin_x_m, double origin_y_m);
  void set(int ix, int iy, double cost);
  double at(int ix, int iy) const;

  const std::uint8_t* data() const { return cost_.data(); }
  std::uint8_t* data() { return cost_.data(); }
  std::uint8_t outside() const { return outside_; }

 private:
  GridGeometry geometry_;
  std::vector<std::uint8_t> cost_;
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
/// @param interpolate bilinear between cell centres; otherwise the nearest cell
void alignment_costs(const CostField& field, const WeightedPoints& points_robot, const ParticleSet& particles,
                     bool interpolate, std::vector<float>* cost);

}  // namespace knav
