#include "global_map_builder/view_pairs.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace knav {
namespace {

constexpr double kMinFacing = 0.85;     // cosine between two surfaces' normals
constexpr double kMaxAlong_m = 0.4;     // between two points of one surface, along it
constexpr double kProbeGate_m = 0.5;
constexpr double kMinAgreeing = 0.5;    // share of what both should see
constexpr std::size_t kProbes = 24;     // points that tell whether two views share anything

struct Relative {
  Eigen::Matrix2d R;
  Eigen::Vector2d t;
  explicit Relative(const Pose2& T) : t(T.x_m, T.y_m) {
    const double c = std::cos(T.yaw_rad), s = std::sin(T.yaw_rad);
    R << c, -s, s, c;
  }
};

/// The point of `from` that shows the surface of a point of `to`; null if none does.
/// @param q  the point of `to` in from's keyframe frame
const ViewPoint* partner(const DriveView& from, const ViewPoint& p, const Relative& T_from_to, double gate_m,
                         Eigen::Vector2d* q, bool* hidden = nullptr) {
  if (hidden != nullptr) *hidden = true;
  *q = T_from_to.R * p.on_line + T_from_to.t;
  const int bin = from.bin_of(*q);
  if (bin < 0) return nullptr;
  const ViewPoint& s = from.points()[static_cast<std::size_t>(bin)];
  if (!s.straight) return nullptr;
  // Behind what the other sees it may be anything.
  if (hidden != nullptr) *hidden = (*q - from.eye()).norm() > s.range_m + gate_m;
  if (s.normal.dot(T_from_to.R * p.normal) < kMinFacing) return nullptr;
  const Eigen::Vector2d apart = *q - s.on_line;
  const double off = s.normal.dot(apart);
  if (std::fabs(off) > gate_m || std::fabs(s.normal.x() * apart.y() - s.normal.y() * apart.x()) > kMaxAlong_m + gate_m)
    return nullptr;
  return &s;
}

/// Sums what points with the same knots add, ten rows and columns of the twenty-four. Neighbours mostly have the same.
class PairSum {
 public:
  explicit PairSum(PairEquations* out) : out_(out) {}

  /// @param J  of the two poses (six), from's two knots, to's two
  void add(int from_knot, int to_knot, const Eigen::Matrix<double, 10, 1>& J, double w, double off) {
    if (from_knot != from_knot_ || to_knot != to_knot_) {
      flush();
      from_knot_ = from_knot;
      to_knot_ = to_knot;
    }
    H_.noalias() += (w * J) * J.transpose();
    g_.noalias() += (w * off) * J;
  }

  /// Before the sums are read.
  void flush() {
    if (from_knot_ >= 0) {
      const int from = PairEquations::kOffset + from_knot_, to = PairEquations::kOffset + RangeOffset::kKnots + to_knot_;
      const std::array<int, 10> at{0, 1, 2, 3, 4, 5, from, from + 1, to, to + 1};
      out_->H(at, at) += H_;
      out_->g(at) += g_;
    }
    H_.setZero();
    g_.setZero();
  }

 private:
  PairEquations* out_;
  int from_knot_ = -1, to_knot_ = -1;
  Eigen::Matrix<double, 10, 10> H_ = Eigen::Matrix<double, 10, 10>::Zero();
  Eigen::Matrix<double, 10, 1> g_ = Eigen::Matrix<double, 10, 1>::Zero();
};

double shared_part(const DriveView& from, const DriveView& to, const Relative& T_from_to) {
  const std::size_t count = to.points().size(), stride = std::max<std::size_t>(1, count / kProbes);
  int probes = 0, shared = 0;
  Eigen::Vector2d q;
  for (std::size_t i = stride / 2; i < count; i += stride) {
    const ViewPoint& p = to.points()[i];
    if (!p.straight) continue;
    ++probes;
    if (partner(from, p, T_from_to, kProbeGate_m, &q) != nullptr) ++shared;
  }
  return probes < 4 ? 0.0 : static_cast<double>(shared) / static_cast<double>(kProbes);
}

}  // namespace

std::vector<ViewPair> find_view_pairs(const JointRefinementConfig& config, const std::vector<DriveView>& views,
                                      const std::vector<Pose2>& T_map_keyframe, const std::vector<double>& path_m) {
  std::vector<std::vector<int>> partners(views.size());
  tbb::parallel_for(std::size_t{0}, views.size(), [&](std::size_t to) {
    if (views[to].empty()) return;
    for (std::size_t from = 0; from < to; ++from) {
      if (views[from].empty() || path_m[to] - path_m[from] < config.min_path_m ||
          distance_m(T_map_keyframe[from], T_map_keyframe[to]) > config.max_apart_m) {
        continue;
      }
      const Relative T_from_to(T_map_keyframe[from].inverse() * T_map_keyframe[to]);
      if (shared_part(views[from], views[to], T_from_to) >= config.min_shared)
        partners[to].push_back(static_cast<int>(from));
    }
  });
  std::vector<ViewPair> pairs;
  const auto most = static_cast<std::size_t>(config.max_partners);
  for (std::size_t to = 0; to < views.size(); ++to) {
    const std::size_t take = std::min(most, partners[to].size());
    for (std::size_t k = 0; k < take; ++k) {
      pairs.push_back({partners[to][k * partners[to].size() / take], static_cast<int>(to)});
    }
  }
  return pairs;
}

void compare_views(const DriveView& from, const DriveView& to, const Pose2& T_map_from, const Pose2& T_map_to,
                   double gate_m, double fade_sd, PairEquations* out) {
  out->H.setZero();
  out->g.setZero();
  out->cost = 0.0;
  out->points = 0;
  const Relative T_from_to(T_map_from.inverse() * T_map_to), A(T_map_from), B(T_map_to);
  const Eigen::Vector2d to_from(T_map_from.x_m, T_map_from.y_m), to_to(T_map_to.x_m, T_map_to.y_m);
  Eigen::Vector2d q;
  double comparable = 0.0, agreeing = 0.0;
  PairSum sum(out);
  for (const ViewPoint& p : to.points()) {
    if (!p.straight) continue;
    bool hidden = false;
    const ViewPoint* s = partner(from, p, T_from_to, gate_m, &q, &hidden);
    if (!hidden) ++comparable;
    if (s == nullptr) continue;
    const double off = s->normal.dot(q - s->on_line);
    const double variance = p.sd_m * p.sd_m + s->sd_m * s->sd_m;
    // Geman-McClure: what does not belong together fades out.
    const double z2 = off * off / (fade_sd * fade_sd * variance), fade = 1.0 / ((1.0 + z2) * (1.0 + z2));
    out->cost += z2 / (1.0 + z2);
    agreeing += 1.0 / (1.0 + z2);
    ++out->points;
    const Eigen::Vector2d n = A.R * s->normal, at = B.t + B.R * p.on_line;
    const Eigen::Vector2d a = at - to_from, b = at - to_to;
    const RangeOffset::Place ps = RangeOffset::place(s->column_share), pp = RangeOffset::place(p.column_share);
    const double ds = -n.dot(A.R * s->per_offset), dp = n.dot(B.R * p.per_offset);
    Eigen::Matrix<double, 10, 1> J;
    J << -n.x(), -n.y(), n.x() * a.y() - n.y() * a.x(), n.x(), n.y(), -n.x() * b.y() + n.y() * b.x(), (1.0 - ps.share) * ds,
        ps.share * ds, (1.0 - pp.share) * dp, pp.share * dp;
    sum.add(ps.first, pp.first, J, fade / variance, off);
  }
  sum.flush();
  // Views that contradict each other as much as they agree are of different things.
  const double share = comparable > 0.0 ? agreeing / comparable : 0.0;
  const double trust = std::clamp((share - kMinAgreeing) / (1.0 - kMinAgreeing), 0.0, 1.0);
  out->H *= trust;
  out->g *= trust;
  out->cost *= trust;
  out->weight = trust * out->points;
}

}  // namespace knav
