#include "planner_tracker/search_graph.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace knav {
namespace {

constexpr double kDiagonal = 1.41421356237309505;
constexpr double kKnight = 2.23606797749978970;

}  // namespace

const SearchMove kSearchMove[kSearchMoves] = {
    {1, 0, 1.0},       {0, 1, 1.0},        {-1, 0, 1.0},        {0, -1, 1.0},
    {1, 1, kDiagonal}, {-1, 1, kDiagonal}, {-1, -1, kDiagonal}, {1, -1, kDiagonal},
    {2, 1, kKnight},   {1, 2, kKnight},    {-1, 2, kKnight},    {-2, 1, kKnight},
    {-2, -1, kKnight}, {-1, -2, kKnight},  {1, -2, kKnight},    {2, -1, kKnight}};

ClearancePrice::ClearancePrice(const MapLayer& layer, double hard_m, double preferred_m, double price) {
  const int cut = layer.squared_cut();
  hard_squared_ = static_cast<std::int16_t>(std::min(layer.squared_for(hard_m), cut));
  factor_.assign(static_cast<std::size_t>(cut) + 1, 0);
  for (int d = hard_squared_; d <= cut; ++d) {
    const double clearance = layer.clearance_of(static_cast<std::int16_t>(d));
    const double short_of = preferred_m > hard_m ? (preferred_m - clearance) / (preferred_m - hard_m) : 0.0;
    const double dearer = price * std::pow(std::clamp(short_of, 0.0, 1.0), 2);
    factor_[static_cast<std::size_t>(d)] = static_cast<std::uint32_t>(std::lround(256.0 * (1.0 + dearer)));
  }
}

SearchGraph::SearchGraph(const MapLayer& layer, const ClearancePrice& price, int stride)
    : layer_(&layer),
      price_(&price),
      stride_(stride),
      width_((layer.geometry.width_cells + stride - 1) / stride),
      height_((layer.geometry.height_cells + stride - 1) / stride) {
  const std::ptrdiff_t row = layer.geometry.width_cells;
  for (int m = 0; m < kSearchMoves; ++m) {
    const int dx = kSearchMove[m].dx * stride, dy = kSearchMove[m].dy * stride;
    length_mm_[m] = static_cast<std::uint32_t>(
        std::max(1L, std::lround(1000.0 * kSearchMove[m].length * stride * layer.geometry.resolution_m)));
    end_[m] = dy * row + dx;
    // The cells whose centres the move comes nearest to, one a step along its longer side.
    const int steps = std::max(std::abs(dx), std::abs(dy));
    for (int i = 1; i < steps; ++i) {
      const double fx = static_cast<double>(dx) * i / steps, fy = static_cast<double>(dy) * i / steps;
      between_[m][between_count_[m]++] = std::lround(fy) * row + std::lround(fx);
    }
  }
}

}  // namespace knav
