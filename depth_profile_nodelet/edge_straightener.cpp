#include "depth_profile_nodelet/edge_straightener.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/multiversion.h"
#include "kinect_calib/kinect_noise.h"

namespace knav {
namespace {

constexpr auto kJump_per_m = static_cast<float>(8.0 * kInverseDepthPerCode);  // well above the noise
constexpr int kReach_rows = 12;        // at 1 rad/s the shift runs through a whole pixel within 25 rows
constexpr int kShortest_rows = 7;      // of edges worth moving
constexpr float kNextRow_px = 1.3f;    // roundings of two rows may differ by 1
constexpr double kUpright_px2 = 0.16;  // rounding has a variance of 1/12; what slants or wriggles has more
constexpr std::size_t kMostEdgesPerRow = 96;  // more is noise

/// 1 where the surface between columns u - 1 and u breaks off; a reading beside none is a break too.
KNAV_MULTIVERSION
void find_jumps(const float* z_m, int width, std::uint8_t* jump) {
  for (int u = 1; u < width; ++u) {
    const float a = z_m[u - 1], b = z_m[u];
    const float difference = a > b ? a - b : b - a;
    const bool none_a = !(a == a), none_b = !(b == b);
    jump[u] = static_cast<std::uint8_t>((difference > kJump_per_m * a * b) | (none_a != none_b));
  }
}

bool breaks(float a, float b) {
  return std::isnan(a) != std::isnan(b) || std::abs(a - b) > kJump_per_m * a * b;
}

}  // namespace

void EdgeStraightener::start(int rows, int width_px) {
  width_px_ = width_px;
  jump_.assign((static_cast<std::size_t>(width_px) + 7) / 8 * 8, 0);
  edges_.clear();
  edges_.reserve(static_cast<std::size_t>(rows) * kMostEdgesPerRow);
  chain_.reserve(static_cast<std::size_t>(rows));
  sum_.reserve(static_cast<std::size_t>(rows) + 1);
  sum_squares_.reserve(static_cast<std::size_t>(rows) + 1);
  row_above_begin_ = row_above_end_ = 0;
}

void EdgeStraightener::add_row(int v, const float* unrolled_m, const RowWarp& warp) {
  find_jumps(unrolled_m, width_px_, jump_.data());
  const std::size_t begin = edges_.size();
  for (std::size_t word = 0; word < jump_.size(); word += 8) {
    std::uint64_t eight;
    std::memcpy(&eight, &jump_[word], 8);
    if (eight == 0) continue;
    for (std::size_t u = word; u < word + 8; ++u) {
      if (jump_[u] == 0 || edges_.size() - begin >= kMostEdgesPerRow) continue;
      const float shift = warp.shift_px(static_cast<int>(u));
      const float from = static_cast<float>(u) + std::floor(shift + 0.5f);
      if (from < 1.0f || from >= static_cast<float>(width_px_)) continue;  // the edge of the image itself
      const float left = unrolled_m[u - 1], right = unrolled_m[u];
      Edge edge;
      edge.at_px = static_cast<float>(u) - 0.5f + (std::floor(shift + 0.5f) - shift);
      edge.row = static_cast<std::int16_t>(v);
      edge.column = static_cast<std::int16_t>(u);
      edge.near_side = right < left || std::isnan(left) ? 1 : -1;
      edge.below = -1;
      edge.begins = true;
      edges_.push_back(edge);
    }
  }
  // The same edges one row up; both lists rise with the column.
  std::size_t above = row_above_begin_;
  for (std::size_t i = begin; i < edges_.size(); ++i) {
    while (above < row_above_end_ && edges_[above].at_px < edges_[i].at_px - kNextRow_px) ++above;
    for (std::size_t k = above; k < row_above_end_ && edges_[k].at_px <= edges_[i].at_px + kNextRow_px; ++k) {
      if (edges_[k].near_side != edges_[i].near_side || edges_[k].below >= 0) continue;
      edges_[k].below = static_cast<std::int32_t>(i);
      edges_[i].begins = false;
      break;
    }
  }
  row_above_begin_ = begin;
  row_above_end_ = edges_.size();
}

void EdgeStraightener::finish(cv::Mat* unrolled_m) {
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    if (edges_[i].begins && edges_[i].below >= 0) straighten(static_cast<std::int32_t>(i), unrolled_m);
  }
}

void EdgeStraightener::straighten(std::int32_t first, cv::Mat* unrolled_m) {
  chain_.clear();
  sum_.assign(1, 0.0);
  sum_squares_.assign(1, 0.0);
  for (std::int32_t i = first; i >= 0; i = edges_[static_cast<std::size_t>(i)].below) {
    const double at = edges_[static_cast<std::size_t>(i)].at_px;
    chain_.push_back(i);
    sum_.push_back(sum_.back() + at);
    sum_squares_.push_back(sum_squares_.back() + at * at);
  }
  const auto length = static_cast<int>(chain_.size());
  if (length < kShortest_rows) return;
  for (int i = 0; i < length; ++i) {
    // As far up as down, so that an edge which leans a little stays where it is.
    const int reach = std::min({kReach_rows, i, length - 1 - i});
    if (2 * reach + 1 < kShortest_rows) continue;
    const auto low = static_cast<std::size_t>(i - reach), high = static_cast<std::size_t>(i + reach + 1);
    const double n = 2 * reach + 1, mean = (sum_[high] - sum_[low]) / n;
    if ((sum_squares_[high] - sum_squares_[low]) / n - mean * mean > kUpright_px2) continue;
    const Edge& edge = edges_[static_cast<std::size_t>(chain_[static_cast<std::size_t>(i)])];
    float* row = unrolled_m->ptr<float>(edge.row);
    const int u = edge.column, straight = static_cast<int>(std::ceil(mean));
    if (straight == u + 1 && u + 1 < width_px_ && !breaks(row[u], row[u + 1])) row[u] = row[u - 1];
    if (straight == u - 1 && u >= 2 && !breaks(row[u - 2], row[u - 1])) row[u - 1] = row[u];
  }
}

}  // namespace knav
