#include "core/contour.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/fast_math.h"
#include "core/free_blocks.h"

namespace knav {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

/// Lengths along a ray in 2^-32 cells: whole numbers, so that a jump over many edges arrives where single
/// steps do.
using Along = std::int64_t;
constexpr double kAlongPerCell = 4294967296.0;
constexpr Along kNever = Along{1} << 56;  ///< longer than any ray, and 32 of them still fit

double cells_of(Along t) { return static_cast<double>(t) * (1.0 / kAlongPerCell); }

/// Visits the cells on a ray in order (Amanatides and Woo). Quad (ix, iy) spans four cell centres, and the
/// dual grid of these quads is walked, so that F is continuous along the ray and one word serves each step.
class QuadWalk {
 public:
  QuadWalk(double x, double y, double dir_x, double dir_y) {  // in cells, quads' corners at integers
    ix = static_cast<int>(std::floor(x));
    iy = static_cast<int>(std::floor(y));
    step_x_ = dir_x > 0.0 ? 1 : -1;
    step_y_ = dir_y > 0.0 ? 1 : -1;
    start(dir_x > 0.0 ? ix + 1 - x : x - ix, std::fabs(dir_x), &next_x_, &delta_x_);
    start(dir_y > 0.0 ? iy + 1 - y : y - iy, std::fabs(dir_y), &next_y_, &delta_y_);
  }
  Along leaves_at() const { return std::min(next_x_, next_y_); }
  void step() {
    // Without a branch: which way comes next is a coin toss, and a wrong guess costs more than both sums.
    const bool along_x = next_x_ < next_y_;
    ix += along_x ? step_x_ : 0;
    iy += along_x ? 0 : step_y_;
    next_x_ += along_x ? delta_x_ : 0;
    next_y_ += along_x ? 0 : delta_y_;
  }

  /// As many steps as leave the square, in which the walk is, unless that is farther than `limit`.
  /// @param left_at   where it was left
  /// @param last_ix, last_iy  the last quad before that
  bool leave(const FreeBlocks::Square& square, Along limit, Along* left_at, int* last_ix, int* last_iy) {
    int x = step_x_ > 0 ? square.high_x - ix : ix - square.low_x;  // edges to cross before the last one
    int y = step_y_ > 0 ? square.high_y - iy : iy - square.low_y;
    const Along out_x = next_x_ + x * delta_x_, out_y = next_y_ + y * delta_y_;
    const bool along_x = out_x < out_y;
    const Along out = along_x ? out_x : out_y;
    if (out >= limit) return false;
    // The other way's edges before `out`; those of a tie come first along y, as in step().
    if (along_x) {
      y = out >= next_y_ ? static_cast<int>((out - next_y_) / delta_y_) + 1 : 0;
    } else {
      x = out > next_x_ ? static_cast<int>((out - 1 - next_x_) / delta_x_) + 1 : 0;
    }
    ix += x * step_x_;
    iy += y * step_y_;
    next_x_ += x * delta_x_;
    next_y_ += y * delta_y_;
    *left_at = out;
    *last_ix = ix;
    *last_iy = iy;
    step();
    return true;
  }
  /// As many steps as lie before `end`.
  void step_up_to(Along end) {
    ix += next_x_ < end ? (static_cast<int>((end - 1 - next_x_) / delta_x_) + 1) * step_x_ : 0;
    iy += next_y_ < end ? (static_cast<int>((end - 1 - next_y_) / delta_y_) + 1) * step_y_ : 0;
  }
  int ix, iy;

 private:
  static void start(double to_edge, double speed, Along* next, Along* delta) {
    const bool moves = speed * static_cast<double>(kNever) > kAlongPerCell;
    *delta = moves ? static_cast<Along>(kAlongPerCell / speed) : kNever;
    *next = moves ? static_cast<Along>(to_edge * static_cast<double>(*delta)) : kNever;
  }

  int step_x_, step_y_;
  Along delta_x_, delta_y_, next_x_, next_y_;
};

/// F * 127 at a point of a quad between its known corners; NaN if none is known.
float value_in(std::uint32_t quad, float tx, float ty) {
  const float share[4] = {(1 - tx) * (1 - ty), tx * (1 - ty), (1 - tx) * ty, tx * ty};
  float sum = 0.0f, known = 0.0f;
  for (int corner = 0; corner < 4; ++corner) {
    const auto byte = static_cast<std::int8_t>((quad >> (8 * corner)) & 0xFFu);
    if (byte == TsdfGrid::kUnknown) continue;
    const float w = share[corner] + 1e-6f;
    sum += w * static_cast<float>(byte);
    known += w;
  }
  return known > 0.0f ? sum / known : kNaN;
}

constexpr std::uint32_t kSigns = 0x80808080u;  // set in a corner that is negative or unknown
constexpr std::uint32_t kAllUnknown = 0x80808080u;

float newest_seen(const TsdfGrid& grid, int ix, int iy) {
  float seen = 0.0f;
  for (int dy = 0; dy < 2; ++dy) {
    for (int dx = 0; dx < 2; ++dx) seen = std::max(seen, grid.last_seen_s(ix + dx, iy + dy));
  }
  return seen;
}

RayEnd cast(const TsdfGrid& grid, const ContourConfig& config, const FreeBlocks* blocks, double x_m,
            double y_m, double dir_x, double dir_y, double length_m) {
  const double scale = 1.0 / grid.resolution_m();
  const double x = x_m * scale - 0.5, y = y_m * scale - 0.5;  // quad corners (cell centres) at integers
  const auto along = [scale](double metres) { return static_cast<Along>(metres * scale * kAlongPerCell); };
  const Along length = along(length_m), blind = along(config.blind_radius_m),
              gap = along(config.unknown_gap_m);
  const std::uint32_t* const quads = grid.quads();
  const SurfaceRule rule(config.surface_within);
  QuadWalk walk(x, y, dir_x, dir_y);
  Along entered = 0;       // where the ray entered the present quad
  Along unknown_from = 0;  // where the present stretch of unknown began
  Along positive_at = -1;  // the last place where F was known and positive, without unknown since
  int positive_ix = 0, positive_iy = 0;  // its quad; the value there is only worked out at a crossing
  RayEnd end;
  const auto value_at = [&](int ix, int iy, Along at) {
    const double t = cells_of(at);
    return value_in(quads[grid.quad_index(ix, iy)], static_cast<float>(x + t * dir_x - ix),
                    static_cast<float>(y + t * dir_y - iy));
  };
  const auto inside = static_cast<unsigned>(grid.size_cells() - 1);
  const int first_x = grid.first_x(), first_y = grid.first_y();
  int asked_x = std::numeric_limits<int>::min(), asked_y = asked_x;  // the last block that was asked for
  while (entered < length) {
    if (static_cast<unsigned>(walk.ix - first_x) >= inside ||
        static_cast<unsigned>(walk.iy - first_y) >= inside)
      break;
    const int block_x = walk.ix >> FreeBlocks::kShift, block_y = walk.iy >> FreeBlocks::kShift;
    if (blocks && (block_x != asked_x || block_y != asked_y)) {
      asked_x = block_x;
      asked_y = block_y;
      FreeBlocks::Square square;
      switch (blocks->kind(walk.ix, walk.iy, &square)) {
        case FreeBlocks::Kind::kFree:
          if (walk.leave(square, length, &entered, &positive_ix, &positive_iy)) {
            positive_at = unknown_from = entered;
          } else {
            walk.step_up_to(length);
            entered = positive_at = length;
            end.kind = RayEnd::Kind::kFree;
            end.last_seen_s = grid.last_seen_s(walk.ix, walk.iy);
          }
          continue;
        case FreeBlocks::Kind::kUnknown: {
          // Only where the stretch of unknown may not end the ray.
          const Along limit = std::min(length, std::max(unknown_from, blind) + gap);
          int ix, iy;
          if (walk.leave(square, limit, &entered, &ix, &iy) ||
              walk.leave(FreeBlocks::block(walk.ix, walk.iy), limit, &entered, &ix, &iy)) {
            positive_at = -1;
            continue;
          }
          break;
        }
        case FreeBlocks::Kind::kMixed:
          break;
      }
    }
    const Along leaves = std::min(walk.leaves_at(), length);
    const std::uint32_t quad = quads[grid.quad_index(walk.ix, walk.iy)];
    if ((quad & kSigns) == 0 && quad != 0) {  // all corners known and none negative
      positive_at = leaves;
      positive_ix = walk.ix;
      positive_iy = walk.iy;
      unknown_from = leaves;
    } else if (quad == kAllUnknown) {
      positive_at = -1;  // positive next to unknown is no surface
      if (leaves - std::max(unknown_from, blind) > gap) break;
    } else {
      // The middle and the far edge of the ray's way through the quad.
      for (const Along t : {entered + (leaves - entered) / 2, leaves}) {
        const float value = value_at(walk.ix, walk.iy, t);
        if (value > 0.0f) {
          positive_at = t;
          positive_ix = walk.ix;
          positive_iy = walk.iy;
        } else {
          if (positive_at >= 0) {
            if (!rule.near_in(quad) && !rule.near_in(quads[grid.quad_index(positive_ix, positive_iy)])) {
              end.range_m = static_cast<float>(cells_of(t) * grid.resolution_m());  // into a shadow: unknown
              return end;
            }
            const float before = value_at(positive_ix, positive_iy, positive_at);
            const double share = before > value ? static_cast<double>(-value / (before - value)) : 0.0;
            const double back = cells_of(t - positive_at) * share;
            end.kind = RayEnd::Kind::kSurface;
            end.range_m = static_cast<float>((cells_of(t) - back) * grid.resolution_m());
            end.last_seen_s = newest_seen(grid, walk.ix, walk.iy);
            return end;
          }
          positive_at = -1;  // behind a surface that the ray did not cross from its front
        }
      }
      unknown_from = leaves;
    }
    entered = leaves;
    if (entered >= length) {
      if (positive_at >= 0) {
        end.kind = RayEnd::Kind::kFree;
        end.last_seen_s = grid.last_seen_s(walk.ix, walk.iy);
      }
      break;
    }
    walk.step();
  }
  end.range_m = static_cast<float>(cells_of(entered) * grid.resolution_m());
  return end;
}

}  // namespace

RayEnd cast_ray(const TsdfGrid& grid, const ContourConfig& config, double x_m, double y_m, double dir_x,
                double dir_y, double length_m) {
  return cast(grid, config, nullptr, x_m, y_m, dir_x, dir_y, length_m);
}

void extract_contour(const TsdfGrid& grid, const ContourConfig& config, const Pose2& T, float now_age_clock_s,
                     RangeScan* scan) {
  const auto rays = static_cast<std::size_t>(config.rays);
  scan->angle_min_rad = -kPi;
  scan->angle_increment_rad = 2.0 * kPi / config.rays;
  scan->range_min_m = 0.0;
  scan->range_max_m = config.range_max_m;
  scan->range_m.resize(rays);
  scan->evidence.resize(rays);
  static thread_local FreeBlocks blocks;
  static thread_local std::vector<double> angle, cosine, sine;
  blocks.build(grid, T.x_m, T.y_m, config.range_max_m);
  for (std::vector<double>* field : {&angle, &cosine, &sine}) field->resize(rays);
  for (std::size_t i = 0; i < rays; ++i) {
    angle[i] = T.yaw_rad + scan->angle_min_rad + static_cast<double>(i) * scan->angle_increment_rad;
  }
  cos_sin(angle.data(), rays, cosine.data(), sine.data());
  for (std::size_t i = 0; i < rays; ++i) {
    const RayEnd end = cast(grid, config, &blocks, T.x_m, T.y_m, cosine[i], sine[i], config.range_max_m);
    const bool unknown = end.kind == RayEnd::Kind::kUnknown;
    scan->range_m[i] = unknown ? kNaN : end.kind == RayEnd::Kind::kFree ? kInf : end.range_m;
    const float age_s = std::max(0.0f, now_age_clock_s - end.last_seen_s);
    scan->evidence[i] = unknown ? 0.0f : std::exp(-age_s / static_cast<float>(config.evidence_decay_s));
  }
}

void merge_newest(const TsdfObservation& o, const Pose2& T_map_robot, RangeScan* scan) {
  const Pose2 T_robot_sensor = T_map_robot.inverse() * o.T_map_sensor;
  const double c = std::cos(T_robot_sensor.yaw_rad), s = std::sin(T_robot_sensor.yaw_rad);
  const auto rays = static_cast<std::ptrdiff_t>(scan->range_m.size());
  const double increment = scan->angle_increment_rad;
  static thread_local std::vector<float> newest;
  newest.assign(scan->range_m.size(), kInf);
  const auto index_of = [&](std::ptrdiff_t ray) { return static_cast<std::size_t>(((ray % rays) + rays) % rays); };
  const auto put = [&](std::ptrdiff_t ray, double range) {
    float& value = newest[index_of(ray)];
    value = std::min(value, static_cast<float>(range));
  };
  bool have_last = false;
  double last_x = 0.0, last_y = 0.0, last_range = 0.0;
  for (std::size_t i = 0; i < o.columns(); ++i) {
    if (std::isnan(o.range_m[i])) {
      have_last = false;
      continue;
    }
    const double px = static_cast<double>(o.direction_x[i] * o.range_m[i]);
    const double py = static_cast<double>(o.direction_y[i] * o.range_m[i]);
    const double x = T_robot_sensor.x_m + c * px - s * py, y = T_robot_sensor.y_m + s * px + c * py;
    const double angle = std::atan2(y, x), range = std::hypot(x, y);
    const auto own = static_cast<std::ptrdiff_t>(std::lround((angle - scan->angle_min_rad) / increment));
    if (o.cut(i)) {
      // The map knows where it begins, if it was seen from farther off.
      if (!(scan->range_m[index_of(own)] < static_cast<float>(range))) put(own, range);
      have_last = false;
      continue;
    }
    put(own, range);
    const double gap = std::hypot(x - last_x, y - last_y);
    if (have_last && gap < 0.1 + 0.05 * std::min(range, last_range)) {
      // One surface: every ray between the two columns meets the line between their points.
      const double last_angle = std::atan2(last_y, last_x);
      const double turn = normalize_angle_rad(angle - last_angle);
      const double from = (turn > 0 ? last_angle : angle) - scan->angle_min_rad;
      const auto first = static_cast<std::ptrdiff_t>(std::ceil(from / increment));
      const auto last = static_cast<std::ptrdiff_t>(std::floor((from + std::fabs(turn)) / increment));
      const double nx = -(y - last_y), ny = x - last_x, offset = nx * x + ny * y;
      for (std::ptrdiff_t ray = first; ray <= last; ++ray) {
        const double a = scan->angle_min_rad + static_cast<double>(ray) * increment;
        const double along = nx * std::cos(a) + ny * std::sin(a);
        if (std::fabs(along) > 1e-9) put(ray, offset / along);
      }
    }
    have_last = true;
    last_x = x;
    last_y = y;
    last_range = range;
  }
  for (std::size_t i = 0; i < newest.size(); ++i) {
    if (!(newest[i] < kInf) || newest[i] > scan->range_max_m) continue;
    scan->range_m[i] = newest[i];
    scan->evidence[i] = 1.0f;
  }
}

}  // namespace knav
