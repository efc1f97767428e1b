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

namespace {

/// The last pass adds two squares of at most this in 16 bits.
constexpr int kMostUnits = 127;

}  // namespace

struct TruncatedDistance::Sweep {
  int width, height;
  const std::uint8_t* cells;
  std::uint8_t open;
  const SurfaceOffset* surface;
  CellWindow window;
  int wide, first_column;  ///< of the scratch rows: the window and a reach on either side
  int in0, in1;            ///< their columns that lie on the grid; the others stay 0, blocked
  std::ptrdiff_t row(int y) const { return static_cast<std::ptrdiff_t>(y - window.y0) * wide; }
};

TruncatedDistance::TruncatedDistance(int reach_cells, int units_per_cell)
    : reach_(reach_cells), units_(units_per_cell), cut_(static_cast<std::int16_t>((reach_cells + 1) * units_per_cell * (reach_cells + 1) * units_per_cell)) {
  if (reach_cells < 1 || units_per_cell < 1 || (reach_cells + 1) * units_per_cell > kMostUnits) {
    throw std::invalid_argument("(reach + 1) * units must lie in 2 ... 127");
  }
}

int TruncatedDistance::finest_units(int reach_cells) { return std::clamp(kMostUnits / (reach_cells + 1), 1, 8); }

void TruncatedDistance::nearest_along_columns(const Sweep& s) {
  const int r = reach_;
  const auto unit = static_cast<std::int16_t>(units_), far = static_cast<std::int16_t>((r + 1) * units_);
  const auto start = [&](bool outside_grid) {
    std::fill(run_.begin() + s.in0, run_.begin() + s.in1, outside_grid ? std::int16_t{0} : far);
    std::fill(run_aside_.begin(), run_aside_.end(), std::int16_t{0});
  };
  // A surface's distance from its own cell's middle is negative where the sweep has passed it before.
  const auto sweep_row = [&](int y, int direction) {
    const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(y) * s.width + s.first_column;
    const std::uint8_t* cell = s.cells + first;
    std::int16_t* run = run_.data();
    if (s.surface == nullptr) {
      for (int x = s.in0; x < s.in1; ++x) {
        const auto next = std::min(static_cast<std::int16_t>(run[x] + unit), far);
        run[x] = cell[x] == s.open ? next : std::int16_t{0};
      }
      return;
    }
    const SurfaceOffset* at = s.surface + first;
    std::int16_t* aside = run_aside_.data();
    for (int x = s.in0; x < s.in1; ++x) {
      const auto next = std::min(static_cast<std::int16_t>(run[x] + unit), far);
      const bool open = cell[x] == s.open;
      run[x] = open ? next : static_cast<std::int16_t>(-direction * at[x].y);
      aside[x] = open ? aside[x] : static_cast<std::int16_t>(at[x].x);
    }
  };
  start(s.window.y0 - r <= 0);
  for (int y = std::max(0, s.window.y0 - r); y < s.window.y1; ++y) {
    sweep_row(y, 1);
    if (y < s.window.y0) continue;
    std::copy(run_.begin(), run_.end(), rows_.begin() + s.row(y));
    if (s.surface != nullptr) std::copy(run_aside_.begin(), run_aside_.end(), aside_.begin() + s.row(y));
  }
  start(s.window.y1 + r >= s.height);
  for (int y = std::min(s.height, s.window.y1 + r) - 1; y >= s.window.y0; --y) {
    sweep_row(y, -1);
    if (y >= s.window.y1) continue;
    std::int16_t *out = rows_.data() + s.row(y), *aside = aside_.data() + s.row(y);
    const std::int16_t *run = run_.data(), *run_aside = run_aside_.data();
    if (s.surface == nullptr) {
      for (int x = 0; x < s.wide; ++x) {
        const std::int16_t d = std::min(out[x], run[x]);
        out[x] = static_cast<std::int16_t>(d * d);
      }
      continue;
    }
    for (int x = 0; x < s.wide; ++x) {
      const bool below = run[x] < out[x];
      const std::int16_t d = below ? run[x] : out[x];
      out[x] = static_cast<std::int16_t>(d * d);
      aside[x] = below ? run_aside[x] : aside[x];
    }
  }
}

void TruncatedDistance::nearest_along_rows(const Sweep& s, std::int16_t* squared) {
  const int r = reach_, w = s.window.width();
  for (int y = s.window.y0; y < s.window.y1; ++y) {
    const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(y) * s.width + s.window.x0;
    std::int16_t* out = squared + first;
    const std::int16_t* in = rows_.data() + s.row(y) + r;
    std::fill(out, out + w, cut_);
    if (s.surface == nullptr) {
      for (int dx = -r; dx <= r; ++dx) {
        const auto dx2 = static_cast<std::int16_t>(dx * units_ * dx * units_);
        const std::int16_t* from = in + dx;
        for (int x = 0; x < w; ++x) out[x] = std::min(out[x], static_cast<std::int16_t>(from[x] + dx2));
      }
      continue;
    }
    const std::int16_t* aside = aside_.data() + s.row(y) + r;
    for (int dx = -r; dx <= r; ++dx) {
      const auto step = static_cast<std::int16_t>(dx * units_);
      const std::int16_t *from = in + dx, *to = aside + dx;
      for (int x = 0; x < w; ++x) {
        const auto across = static_cast<std::int16_t>(to[x] + step);
        out[x] = std::min(out[x], static_cast<std::int16_t>(from[x] + across * across));
      }
    }
    // What is open is never nothing away, and what is blocked always is.
    const std::uint8_t* cell = s.cells + first;
    for (int x = 0; x < w; ++x) out[x] = cell[x] == s.open ? std::max(out[x], std::int16_t{1}) : std::int16_t{0};
  }
}

void TruncatedDistance::update(int width, int height, const std::uint8_t* cells, std::uint8_t open, const SurfaceOffset* surface,
                               const CellWindow& wanted, std::int16_t* squared) {
  Sweep s{width, height, cells, open, surface, wanted.clipped(width, height), 0, 0, 0, 0};
  if (s.window.empty()) return;
  s.wide = s.window.width() + 2 * reach_;
  s.first_column = s.window.x0 - reach_;
  s.in0 = std::max(0, -s.first_column);
  s.in1 = std::min(s.wide, width - s.first_column);
  const std::size_t scratch = static_cast<std::size_t>(s.wide) * static_cast<std::size_t>(s.window.height());
  if (rows_.size() < scratch) rows_.resize(scratch);
  if (surface != nullptr && aside_.size() < scratch) aside_.resize(scratch);
  run_.assign(static_cast<std::size_t>(s.wide), 0);
  run_aside_.assign(static_cast<std::size_t>(s.wide), 0);
  nearest_along_columns(s);
  nearest_along_rows(s, squared);
}

}  // namespace knav
