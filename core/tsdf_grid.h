#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/grid_geometry.h"
#include "core/tsdf_observation.h"
#include "core/tsdf_row.h"

namespace knav {

struct TsdfConfig {
  double resolution_m = 0.025;
  TruncationConfig truncation;
  double weight_range_floor_m = 0.5;
  int weight_bits = 16;
  double clear_margin_m = 0.1;
  int contradictions_to_reset = 4;
  double middle_clear_from_m = 0.6;
  double low_clear_range_m = 2.5;
  double front_clear_range_m = 4.0;
  double appear_range_m = 1.2;
  double every_row_to_m = 8.0;
  int threads = 1;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("resolution_m", resolution_m, 0.01, 0.5, "m", "Side of a cell.");
    v.group("truncation", truncation, "The width of a surface's support, which grows with range.");
    v.number("weight_range_floor_m", weight_range_floor_m, 0.1, 5, "m",
             "A reading's weight is 1 / max(distance, this)^2 (equation 4).");
    v.integer("weight_bits", weight_bits, 8, 20, "bit", "Weights are integers: 2^this is weight 1.");
    v.number("clear_margin_m", clear_margin_m, 0, 1, "m",
             "A surface is contradicted where rays pass it freely within this distance on both sides.");
    v.integer("contradictions_to_reset", contradictions_to_reset, 1, 255, "frames",
              "A cell that this many frames contradict forgets what it held.");
    v.number("middle_clear_from_m", middle_clear_from_m, 0, 5, "m",
             "A surface of middle height is contradicted down to here, nearer than the floor is seen: it would still be "
             "in view. Low and high ones only where the floor was seen.");
    v.number("low_clear_range_m", low_clear_range_m, 0, 20, "m",
             "A surface that was seen as low or high is contradicted up to here; from farther away it need not be seen.");
    v.number("front_clear_range_m", front_clear_range_m, 0, 20, "m",
             "Up to here a surface is also contradicted within the truncation before another one (a person who stood at "
             "a wall); 0 = never.");
    v.number("appear_range_m", appear_range_m, 0, 20, "m",
             "Up to here a surface in cells known to be free counts at once, as its going does: before it is too near "
             "for the camera to see it. A low one up to low_clear_range_m, as from farther away it could not be seen. 0 = "
             "never.");
    v.number("every_row_to_m", every_row_to_m, 0, 1000, "m",
             "DepthProfile: up to here a frame is integrated in every row of cells, beyond it in every second one, beyond twice that in every "
             "fourth, in other ones with each frame: most cells lie far away, where one frame of thirty a second says little. 0 = in all "
             "(the paper's).");
    v.integer("threads", threads, 1, 64, "",
              "A frame is integrated, and taken out again, by so many threads; the same bytes with any number. While mapping see map_builder/drive/mapper_threads.");
  }
  std::vector<std::string> validate() const { return {}; }
  /// The largest weight one observation adds to a cell, in integer units.
  double largest_weight() const;
  /// How many observations the 32-bit sums can hold at once, whatever they see.
  double observation_capacity() const { return 2147483647.0 / largest_weight(); }
};

/// What an observation says of cells at these distances from its sensor: from_m <= distance < to_m.
struct TsdfRing {
  float from_m = 0.0f, to_m = std::numeric_limits<float>::infinity();
  bool all() const { return from_m <= 0.0f && std::isinf(to_m); }
};

/// The projective truncated signed distance map of paper section III.D, as a torus that scrolls with the
/// robot.
///
/// Each cell holds the integer sums of w f (as its difference from the next, see TsdfCells) and of w, so that taking an observation away (equations 8, 9) is
/// exact to the bit whatever the order. A cell also remembers since which observation it counts: scrolling a
/// cell in, or clear free evidence against its surface, resets it, and removing an older observation then
/// skips it. Hence a cell always holds exactly the sum of the held observations that are not older than its
/// reset.
///
/// Cells are addressed by absolute integers: cell (ix, iy) has its centre at ((ix + 0.5) res, (iy + 0.5)
/// res).
class TsdfGrid {
 public:
  static constexpr std::int8_t kUnknown = -128;
  static constexpr float kValueScale = 127.0f;

  /// @param half_size_m the window reaches at least this far from its centre (sizes round up to powers of
  /// two)
  /// @param vectors  false: plain code even where there is AVX2, for tests
  TsdfGrid(const TsdfConfig& config, double half_size_m, bool vectors = true);

  /// Everything becomes unknown.
  void clear();
  /// Moves the window so that the point lies within a scroll step of its centre. Cells that enter are
  /// unknown.
  /// @param next_sequence that of the next observation to be added
  void scroll_to(double x_m, double y_m, std::uint32_t next_sequence);

  /// Equations 2-6. The observation's sequence must be larger than any before it.
  void add(const TsdfObservation& observation);
  /// Equations 8, 9. The observation must have been added, and not been removed, since the last clear().
  /// @param part  only this. The rest stays, and has to be removed by itself.
  void remove(const TsdfObservation& observation, const TsdfRing& part = {});

  double resolution_m() const { return config_.resolution_m; }
  int size_cells() const { return size_; }
  /// Absolute index of the lower left cell of the window.
  int first_x() const { return first_x_; }
  int first_y() const { return first_y_; }
  int cell_of(double coordinate_m) const;
  double center_m(int i) const { return (i + 0.5) * config_.resolution_m; }
  bool contains(int ix, int iy) const {
    return ix >= first_x_ && iy >= first_y_ && ix < first_x_ + size_ && iy < first_y_ + size_;
  }
  std::size_t index(int ix, int iy) const {
    return (static_cast<std::size_t>(iy & mask_) << bits_) | static_cast<std::size_t>(ix & mask_);
  }
  int bits() const { return bits_; }

  // By absolute cell; the cell must lie in the window.
  bool known(int ix, int iy) const { return weight_[index(ix, iy)] > 0; }
  /// F in [-1, 1], NaN where W = 0.
  float distance(int ix, int iy) const;
  /// W in the paper's unit, 1 / m^2.
  float weight(int ix, int iy) const;
  std::int32_t weighted_sum_units(int ix, int iy) const { return weighted_sum_units(index(ix, iy)); }
  std::int32_t weight_units(int ix, int iy) const { return weight_[index(ix, iy)]; }
  std::uint32_t reset_sequence(int ix, int iy) const { return reset_[index(ix, iy)]; }
  /// The window's clock when the cell was last touched.
  float last_seen_s(int ix, int iy) const { return last_seen_s_[index(ix, iy)]; }

  /// F of the four cells whose centres surround a point, as signed bytes (kUnknown where W = 0), packed in
  /// one word per lower left cell: bits 0-7 (x, y), 8-15 (x + 1, y), 16-23 (x, y + 1), 24-31 (x + 1, y + 1).
  /// One random read gives all that bilinear interpolation needs.
  const std::uint32_t* quads() const { return quad_.data(); }
  std::size_t quad_index(int ix, int iy) const {
    return static_cast<std::size_t>(iy & mask_) * static_cast<std::size_t>(quad_stride_) +
           static_cast<std::size_t>(ix & mask_);
  }
  /// A row of quads is a cache line longer than a row of cells: rows a power of two apart would all fall into the same
  /// set of the cache, and reading along a wall would miss it every time (3.7 instead of 1 ns a reading).
  int quad_stride() const { return quad_stride_; }
  std::int8_t value(int ix, int iy) const { return value_[index(ix, iy)]; }
  const std::int8_t* values() const { return value_.data(); }  ///< by index()
  /// What of weight_units() surfaces of low or high things gave.
  std::int32_t standing_weight_units(int ix, int iy) const { return standing_weight_[index(ix, iy)]; }
  /// See is_standing().
  bool standing(int ix, int iy) const {
    return is_standing(standing_weight_units(ix, iy), weight_units(ix, iy), weight_unit_);
  }
  float weight_unit() const { return weight_unit_; }
  // By index().
  std::int32_t weighted_sum_units(std::size_t cell) const { return weighted_sum_of(deficit_[cell], weight_[cell]); }
  std::int32_t weight_units(std::size_t cell) const { return weight_[cell]; }

  std::uint64_t cells_reset_by_contradiction() const { return contradicted_; }

 private:
  /// What is needed for some neighbouring rows of cells, one after the other.
  struct Rows {
    std::vector<std::int32_t> column;  ///< the observation's column of each cell of a row, or -1 ...
    std::vector<float> distance_m;     ///< ... its distance from the sensor ...
    std::vector<float> angle_rad;
    TsdfChange first, last;  ///< of the first row and the last, in absolute cells
    std::uint64_t contradicted = 0;
  };

  template <bool kAdd>
  void apply(const TsdfObservation& observation, const TsdfRing& part);
  /// Rows [low_y, high_y) and the quads between them.
  template <bool kAdd>
  void apply_rows(const TsdfObservation& observation, const TsdfRing& part, int low_y, int high_y, Rows* rows);
  double row_reach_m(const TsdfObservation& observation, int iy) const;
  template <bool kAdd>
  TsdfChange apply_row(const TsdfObservation& observation, float cos_yaw, float sin_yaw, int iy, int from_x, int to_x, const TsdfRing& part,
                       Rows* rows);
  void rebuild_quads(int iy, const TsdfChange& below, const TsdfChange& above);
  void rebuild_quads(int iy, int from_x, int to_x);
  void reset_cell(int ix, int iy, std::uint32_t next_sequence);

  TsdfConfig config_;
  int bits_ = 0, size_ = 0, mask_ = 0, quad_stride_ = 0;
  int first_x_ = 0, first_y_ = 0;
  float weight_unit_ = 0.0f;
  TsdfRules rules_;
  std::vector<std::int32_t> weight_, standing_weight_;
  std::vector<std::uint32_t> deficit_;  ///< see TsdfCells
  std::vector<std::uint32_t> reset_;
  std::vector<float> last_seen_s_;
  std::vector<std::int8_t> value_;
  std::vector<std::uint32_t> quad_;
  std::vector<std::uint8_t> contradictions_;
  std::vector<Rows> rows_;  ///< scratch, for each thread's parts
  std::uint64_t contradicted_ = 0;
};

/// F bilinearly between the known cells round a point, in [-1, 1]; returns the weight [0, 1] of the known
/// ones, 0 (and *value untouched) if all are unknown or the point is outside the window.
float interpolate(const TsdfGrid& grid, double x_m, double y_m, float* value);

}  // namespace knav
