#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/grid_geometry.h"
#include "core/tsdf_observation.h"

namespace knav {

struct SurfaceConfig {
  double resolution_m = 0.05;
  double range_max_m = 12.0;
  double front_m = 0.3;
  double behind_m = 0.1;
  double per_range_squared = 0.003;
  double weight_power = 4.0;
  double weight_range_floor_m = 1.0;
  int min_looks = 3;
  double change_m = 0.15;
  double change_range_m = 5.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("resolution_m", resolution_m, 0.01, 0.5, "m", "Side of a cell of the map.");
    v.number("range_max_m", range_max_m, 1, 100, "m", "Readings farther than this do not enter the map.");
    v.number("front_m", front_m, 0.05, 5, "m", "Truncation before a surface.");
    v.number(
        "behind_m", behind_m, 0.02, 5, "m",
        "Truncation behind a surface, at range 0: less than the thinnest wall that is seen from both sides.");
    v.number("per_range_squared", per_range_squared, 0, 0.1, "1/m", "Growth of both with the range squared.");
    v.number("weight_power", weight_power, 0, 8, "",
             "A reading weighs 1 / max(distance, floor)^this; 2 is the paper's, 4 is a Kinect's variance.");
    v.number("weight_range_floor_m", weight_range_floor_m, 0.1, 10, "m",
             "The floor of the distance in that weight.");
    v.integer("min_looks", min_looks, 1, 1000, "", "A cell seen less often stays unknown.");
    v.number("change_m", change_m, 0.02, 2, "m",
             "Where a newer drive puts the surface elsewhere by more than this, it has moved ...");
    v.number("change_range_m", change_range_m, 0.5, 100, "m",
             "... if the newer drive saw the place as well as min_looks looks from this far.");
  }
  std::vector<std::string> validate() const { return {}; }
  ObservationLimits limits() const;
};

/// The projective truncated signed distance (paper section III.D) over a whole building, in metres, without
/// the local mapper's window: observations only enter. Two differences to it, both for walls seen from both
/// sides: the support behind a surface is short, and near observations outweigh far ones by their variance.
class DenseTsdf {
 public:
  DenseTsdf(const GridGeometry& geometry, const SurfaceConfig& config);

  const GridGeometry& geometry() const { return geometry_; }
  /// Only the rows [first_row, last_row) are touched, so that threads can share the grid by rows.
  void add(const TsdfObservation& observation, int first_row, int last_row);
  void add(const TsdfObservation& observation) { add(observation, 0, geometry_.height_cells); }

  /// Takes in what a later drive saw, on the same geometry: where both agree, both count; where they do not,
  /// the later one holds, if it saw the place well enough.
  void renew(const DenseTsdf& later);

  bool known(std::size_t i) const { return looks_[i] >= min_looks_; }
  /// Signed distance [m] along the rays, NaN where unknown.
  float distance_m(std::size_t i) const;
  float weight(std::size_t i) const { return weight_[i]; }
  /// Did readings end in the cell, in proportion to those that passed it? Between an open cell and one behind a
  /// surface lies either that surface or the edge of a shadow, in which none ends.
  bool measured(std::size_t i) const { return ended_[i] > kMeasuredShare * weight_[i]; }

 private:
  void add_row(const TsdfObservation& observation, int iy, int from, int to);
  void update(const TsdfObservation& observation, std::size_t first, int count, const std::int32_t* column,
              const float* square);

  static constexpr float kMeasuredShare = 0.1f;

  GridGeometry geometry_;
  SurfaceConfig config_;
  int min_looks_;
  std::vector<float> sum_, weight_;
  std::vector<float> ended_;  ///< the share of the weight whose readings ended within kEnd_cells
  std::vector<std::uint16_t> looks_;
};

}  // namespace knav
