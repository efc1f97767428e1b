#include "planner_tracker/truncated_distance.h"

#include <algorithm>
#include <stdexcept>

namespace knav {

CellWindow CellWindow::clipped(int width, int height) const {
  return {std::max(x0, 0), std::max(y0, 0), std::min(x1, width), std::min(y1, height)};
}

CellWindow CellWindow::united(const CellWindow& other) const {
  if (other.empty()) return *this;
  if (empty()) return other;
  return {std::min(x0, other.x0), std::min(y0, other.y0), std::max(x1, other.x1), std::max(y1, other.y1)};
}

void CellWindow::include(int ix, int iy) { *this = united({ix, iy, ix + 1, iy + 1}); }

TruncatedDistance::TruncatedDistance(int reach_cells)
    : reach_(reach_cells), cut_(static_cast<std::int16_t>((reach_cells + 1) * (reach_cells + 1))) {
  // Pass 2 adds two squares of at most (reach + 1)^2 in 16 bits.
  if (reach_cells < 1 || reach_cells > 126) throw std::invalid_argument("reach must lie in 1 ... 126 cells");
}

void TruncatedDistance::update(int width, int height, const std::uint8_t* cells, std::uint8_t open,
                               const CellWindow& wanted, std::int16_t* squared) {
  const CellWindow window = wanted.clipped(width, height);
  if (window.empty()) return;
  const int r = reach_;
  const auto far = static_cast<std::int16_t>(r + 1);
  const int wide = window.width() + 2 * r;
  const int first_column = window.x0 - r;
  // Columns of the scratch rows that lie on the grid; the others stay 0, blocked.
  const int in0 = std::max(0, -first_column), in1 = std::min(wide, width - first_column);
  rows_.resize(static_cast<std::size_t>(wide) * static_cast<std::size_t>(window.height()));
  run_.assign(static_cast<std::size_t>(wide), 0);

  const auto sweep_row = [&](int y) {
    const std::uint8_t* cell =
        cells + static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + first_column;
    std::int16_t* run = run_.data();
    for (int x = in0; x < in1; ++x) {
      const auto next = std::min(static_cast<std::int16_t>(run[x] + 1), far);
      run[x] = cell[x] == open ? next : std::int16_t{0};
    }
  };
  const auto start_sweep = [&](bool outside_grid) {
    std::fill(run_.begin() + in0, run_.begin() + in1, outside_grid ? std::int16_t{0} : far);
  };
  const auto row = [&](int y) {
    return rows_.data() + static_cast<std::size_t>(y - window.y0) * static_cast<std::size_t>(wide);
  };
  start_sweep(window.y0 - r <= 0);
  for (int y = std::max(0, window.y0 - r); y < window.y1; ++y) {
    sweep_row(y);
    if (y >= window.y0) std::copy(run_.begin(), run_.end(), row(y));
  }
  start_sweep(window.y1 + r >= height);
  for (int y = std::min(height, window.y1 + r) - 1; y >= window.y0; --y) {
    sweep_row(y);
    if (y >= window.y1) continue;
    std::int16_t* out = row(y);
    const std::int16_t* run = run_.data();
    for (int x = 0; x < wide; ++x) {
      const std::int16_t d = std::min(out[x], run[x]);
      out[x] = static_cast<std::int16_t>(d * d);
    }
  }
  const int w = window.width();
  for (int y = window.y0; y < window.y1; ++y) {
    std::int16_t* out = squared + static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + window.x0;
    const std::int16_t* in = row(y) + r;
    std::fill(out, out + w, cut_);
    for (int dx = -r; dx <= r; ++dx) {
      const auto dx2 = static_cast<std::int16_t>(dx * dx);
      const std::int16_t* from = in + dx;
      for (int x = 0; x < w; ++x) out[x] = std::min(out[x], static_cast<std::int16_t>(from[x] + dx2));
    }
  }
}

}  // namespace knav
