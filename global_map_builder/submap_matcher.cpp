#include "global_map_builder/submap_matcher.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/multiversion.h"

namespace knav {
namespace {

constexpr double kPointSpacing_m = 0.1;  // as Submap samples its contour
constexpr float kCoarseReach_m = 0.6f;   // beyond this a point scores nothing
constexpr double kCoarseStep_m = 0.2;
constexpr double kFineReach_m = 0.3;
constexpr double kWaviness = 0.015;  // mean square of a contour's slope error
constexpr double kInlier_m = 0.15;
constexpr double kMinFacing = 0.7;          // cosine between two surfaces' normals
constexpr std::size_t kCoarsePoints = 120;  // at most 257, or the 16-bit sums overflow
constexpr std::size_t kPeaks = 8;
constexpr double kPeakShare = 0.6;

struct Candidate {
  Pose2 pose;
  double score = 0.0;
};

bool same_place(const MatchConfig& config, const Pose2& a, const Pose2& b) {
  return distance_m(a, b) < config.rival_distance_m &&
         std::fabs(normalize_angle_rad(a.yaw_rad - b.yaw_rad)) < config.rival_angle_deg * kPi / 180.0;
}

std::vector<SurfacePoint> thin(const std::vector<SurfacePoint>& points, std::size_t count) {
  std::vector<SurfacePoint> out;
  const std::size_t take = std::min(count, points.size());
  for (std::size_t i = 0; i < take; ++i) out.push_back(points[i * points.size() / take]);
  return out;
}

/// What a point scores in each coarse cell, 255 on a surface, 0 from kCoarseReach_m on; with a border of
/// zeros.
struct ScoreGrid {
  int width = 0, height = 0;
  double origin_x_m = 0.0, origin_y_m = 0.0;
  std::vector<std::uint8_t> score;

  ScoreGrid(const Submap& map, int border) {
    const GridGeometry& g = map.geometry();
    origin_x_m = g.origin_x_m - border * kCoarseStep_m;
    origin_y_m = g.origin_y_m - border * kCoarseStep_m;
    width = static_cast<int>(std::ceil(g.width_cells * g.resolution_m / kCoarseStep_m)) + 2 * border;
    height = static_cast<int>(std::ceil(g.height_cells * g.resolution_m / kCoarseStep_m)) + 2 * border;
    score.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (int iy = border; iy < height - border; ++iy) {
      for (int ix = border; ix < width - border; ++ix) {
        const auto x = static_cast<float>(origin_x_m + (ix + 0.5) * kCoarseStep_m);
        const auto y = static_cast<float>(origin_y_m + (iy + 0.5) * kCoarseStep_m);
        const float d = std::fabs(map.nearest(x, y, 1e3f));
        if (d < kCoarseReach_m)
          score[at(ix, iy)] = static_cast<std::uint8_t>(255.0f * (1.0f - d / kCoarseReach_m));
      }
    }
  }
  std::size_t at(int ix, int iy) const {
    return static_cast<std::size_t>(iy) * static_cast<std::size_t>(width) + static_cast<std::size_t>(ix);
  }
};

/// Adds to every shift's sum what one point scores there: `side` x `side` shifts, `first` the lowest's cell.
KNAV_MULTIVERSION
void add_shifts(const std::uint8_t* first, int side, int width, std::uint16_t* sum) {
  for (int iy = 0; iy < side; ++iy) {
    const std::uint8_t* row = first + static_cast<std::ptrdiff_t>(iy) * width;
    std::uint16_t* out = sum + static_cast<std::ptrdiff_t>(iy) * side;
    for (int ix = 0; ix < side; ++ix) out[ix] = static_cast<std::uint16_t>(out[ix] + row[ix]);
  }
}

/// Every pose of the window on a lattice, scored by the coarse cell of each point; the best of each
/// neighbourhood.
std::vector<Candidate> search(const MatchConfig& config, const Submap& from, const Submap& to,
                              const Pose2& prior, const MatchWindow& window) {
  const std::vector<SurfacePoint> points = thin(to.points(), kCoarsePoints);
  double reach_m = 1.0;
  for (const SurfacePoint& p : points)
    reach_m = std::max(reach_m, static_cast<double>(std::hypot(p.x_m, p.y_m)));
  const double angle_step = std::min(2.0 * kCoarseStep_m / reach_m, 0.06);
  const int turns = static_cast<int>(std::ceil(window.angle_rad / angle_step));
  const int steps = static_cast<int>(std::ceil(window.radius_m / kCoarseStep_m)), side = 2 * steps + 1;
  const ScoreGrid grid(from, side);
  std::vector<Candidate> all;
  std::vector<std::uint16_t> sum(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
  double best = 0.0;
  for (int turn = -turns; turn <= turns; ++turn) {
    const double yaw = prior.yaw_rad + turn * angle_step, c = std::cos(yaw), s = std::sin(yaw);
    std::fill(sum.begin(), sum.end(), std::uint16_t{0});
    for (const SurfacePoint& p : points) {
      const double x = prior.x_m + c * p.x_m - s * p.y_m, y = prior.y_m + s * p.x_m + c * p.y_m;
      const int ix = static_cast<int>(std::floor((x - grid.origin_x_m) / kCoarseStep_m)) - steps;
      const int iy = static_cast<int>(std::floor((y - grid.origin_y_m) / kCoarseStep_m)) - steps;
      if (ix < 0 || iy < 0 || ix + side > grid.width || iy + side > grid.height)
        continue;  // never near a surface
      add_shifts(&grid.score[grid.at(ix, iy)], side, grid.width, sum.data());
    }
    for (int iy = -steps; iy <= steps; ++iy) {
      for (int ix = -steps; ix <= steps; ++ix) {
        const auto i = static_cast<std::size_t>((iy + steps) * side + ix + steps);
        const double score = sum[i] / (255.0 * static_cast<double>(points.size()));
        if (score < kPeakShare * best || ix * ix + iy * iy > steps * steps) continue;
        best = std::max(best, score);
        all.push_back(
            {{prior.x_m + ix * kCoarseStep_m, prior.y_m + iy * kCoarseStep_m, normalize_angle_rad(yaw)},
             score});
      }
    }
  }
  // Of equals, the one nearer to the prior.
  std::stable_sort(all.begin(), all.end(), [&](const Candidate& a, const Candidate& b) {
    return a.score != b.score ? a.score > b.score : distance_m(a.pose, prior) < distance_m(b.pose, prior);
  });
  std::vector<Candidate> peaks;
  for (const Candidate& candidate : all) {
    if (peaks.size() == kPeaks || candidate.score < kPeakShare * best) break;
    const bool taken = std::any_of(peaks.begin(), peaks.end(), [&](const Candidate& peak) {
      return same_place(config, peak.pose, candidate.pose);
    });
    if (!taken) peaks.push_back(candidate);
  }
  return peaks;
}

struct Fit {
  Pose2 pose;
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();  ///< of (x, y, yaw), per metre squared of residual
  double weight = 0.0;                                ///< of all points
  double score = 0.0;
};

/// Gauss-Newton on the signed distance, each point fading out (Tukey) towards kFineReach_m and where the
/// surfaces face opposite ways, as the two sides of a thin wall do.
Fit refine(const Submap& from, const Submap& to, const Pose2& start) {
  Fit fit{start};
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    double score = 0.0;
    const double c = std::cos(fit.pose.yaw_rad), s = std::sin(fit.pose.yaw_rad);
    for (const SurfacePoint& p : to.points()) {
      const double rx = c * p.x_m - s * p.y_m, ry = s * p.x_m + c * p.y_m;
      double d = 0.0;
      Eigen::Vector2d gradient;
      if (!from.interpolate(fit.pose.x_m + rx, fit.pose.y_m + ry, &d, &gradient)) continue;
      if (std::fabs(d) >= kFineReach_m || gradient.norm() < 0.3) continue;
      const double facing =
          (c * p.normal_x - s * p.normal_y) * gradient.x() + (s * p.normal_x + c * p.normal_y) * gradient.y();
      // Past the end of the other's contour the distance pulls along the wall, which says nothing.
      if (facing < kMinFacing * gradient.norm()) continue;
      const double q = 1.0 - d * d / (kFineReach_m * kFineReach_m);
      const double w = q * q;
      const Eigen::Vector3d J(gradient.x(), gradient.y(), -ry * gradient.x() + rx * gradient.y());
      H += w * J * J.transpose();
      g += w * d * J;
      score += w;
    }
    fit.hessian = H;
    fit.score = score / static_cast<double>(std::max<std::size_t>(1, to.points().size()));
    // A little damping holds directions that nothing constrains.
    const Eigen::Matrix3d damped = H + Eigen::Vector3d(0.5, 0.5, 2.0).asDiagonal().toDenseMatrix();
    fit.weight = score;
    const Eigen::Vector3d step = damped.ldlt().solve(-g);
    if (!step.allFinite()) break;
    const double scale = std::min(1.0, 0.3 / std::max(1e-9, step.head<2>().norm()));
    fit.pose.x_m += scale * step.x();
    fit.pose.y_m += scale * step.y();
    fit.pose.yaw_rad = normalize_angle_rad(fit.pose.yaw_rad + scale * step.z());
    if (step.head<2>().norm() < 1e-4 && std::fabs(step.z()) < 1e-5) break;
  }
  return fit;
}

struct Agreement {
  double overlap = 0.0, agreement = 0.0, residual_m = 0.0, surface_m = 0.0;
};

Agreement agreement_of(const Submap& from, const Submap& to, const Pose2& T_from_to) {
  const double c = std::cos(T_from_to.yaw_rad), s = std::sin(T_from_to.yaw_rad);
  double seen = 0.0, inliers = 0.0, squares = 0.0;
  for (const SurfacePoint& p : to.points()) {
    const double x = T_from_to.x_m + c * p.x_m - s * p.y_m, y = T_from_to.y_m + s * p.x_m + c * p.y_m;
    double d = 0.0;
    Eigen::Vector2d gradient;
    if (!from.interpolate(x, y, &d, &gradient)) continue;
    const bool near = std::fabs(d) < kInlier_m;
    const double facing =
        (c * p.normal_x - s * p.normal_y) * gradient.x() + (s * p.normal_x + c * p.normal_y) * gradient.y();
    if (near && facing > 0.3) {
      inliers += 1.0;
      squares += d * d;
      seen += 1.0;
    } else if (!near && from.known(static_cast<float>(x), static_cast<float>(y))) {
      seen += 1.0;  // the other submap knows the place and shows no such surface
    }
  }
  Agreement a;
  a.overlap = to.points().empty() ? 0.0 : seen / static_cast<double>(to.points().size());
  a.agreement = seen > 0.0 ? inliers / seen : 0.0;
  a.residual_m = inliers > 0.0 ? std::sqrt(squares / inliers) : 1.0;
  a.surface_m = inliers * kPointSpacing_m;
  return a;
}

/// Map-axes Hessian of `from`'s frame to the edge's error, which lies in the axes of `to`.
/// @param floor_m, floor_rad  standard deviations that no match undercuts
Eigen::Matrix3d information_of(const Fit& fit, double floor_m, double floor_rad) {
  // Neighbouring points share their noise: count one in three, each of 5 cm. A direction left open is known
  // to 1 m.
  const double per_point = 1.0 / (3.0 * 0.05 * 0.05);
  const Eigen::Matrix3d weak = Eigen::Vector3d(1.0, 1.0, 30.0).asDiagonal();
  // A straight wall's contour waves by a few degrees, which looks like a hold along the wall: take that out.
  Eigen::Matrix3d hessian = fit.hessian;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(hessian.topLeftCorner<2, 2>());
  const Eigen::Vector2d share =
      ((axes.eigenvalues().array() - kWaviness * fit.weight).max(0.0) / axes.eigenvalues().array().max(1e-9))
          .sqrt();
  Eigen::Matrix3d shrink = Eigen::Matrix3d::Identity();
  shrink.topLeftCorner<2, 2>() = axes.eigenvectors() * share.asDiagonal() * axes.eigenvectors().transpose();
  hessian = shrink * hessian * shrink;
  Eigen::Matrix3d covariance = (hessian * per_point + weak).inverse();
  covariance += Eigen::Vector3d(floor_m * floor_m, floor_m * floor_m, floor_rad * floor_rad)
                    .asDiagonal()
                    .toDenseMatrix();
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  const double c = std::cos(fit.pose.yaw_rad), s = std::sin(fit.pose.yaw_rad);
  R.topLeftCorner<2, 2>() << c, -s, s, c;
  const Eigen::Matrix3d information = (R.transpose() * covariance * R).inverse();
  return 0.5 * (information + information.transpose());
}

/// Fills in what both directions agree on, and the verdict.
void judge(const MatchConfig& config, const Submap& from, const Submap& to, MatchResult* result) {
  const Agreement there = agreement_of(from, to, result->T_from_to);
  const Agreement back = agreement_of(to, from, result->T_from_to.inverse());
  result->overlap = std::min(there.overlap, back.overlap);
  result->agreement = std::min(there.agreement, back.agreement);
  result->residual_m = std::max(there.residual_m, back.residual_m);
  result->surface_m = std::min(there.surface_m, back.surface_m);
  if (result->surface_m < config.min_surface_m) {
    result->reason = fmt::format("only {:.1f} m of wall coincide", result->surface_m);
  } else if (result->overlap < config.min_overlap) {
    result->reason = fmt::format("overlap {:.2f} is too small", result->overlap);
  } else if (result->agreement < config.min_agreement) {
    result->reason = fmt::format("only {:.2f} of what both saw agrees", result->agreement);
  } else if (result->residual_m > config.max_residual_m) {
    result->reason = fmt::format("residual {:.3f} m is too large", result->residual_m);
  } else if (result->rival > config.max_rival) {
    result->reason = fmt::format("another alignment scores {:.2f} of the best", result->rival);
  } else {
    result->accepted = true;
  }
}

}  // namespace

MatchResult match_submaps(const MatchConfig& config, const Submap& from, const Submap& to,
                          const Pose2& T_from_to, const MatchWindow& window) {
  MatchResult result;
  result.T_from_to = T_from_to;
  if (from.empty() || to.empty()) {
    result.reason = "nothing was seen at one of the two places";
    return result;
  }
  std::vector<Fit> fits;
  for (const Candidate& peak : search(config, from, to, T_from_to, window))
    fits.push_back(refine(from, to, peak.pose));
  std::stable_sort(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) { return a.score > b.score; });
  if (fits.empty() || fits.front().score <= 0.0) {
    result.reason = "no alignment found";
    return result;
  }
  const Fit& best = fits.front();
  result.T_from_to = best.pose;
  result.score = best.score;
  result.information = information_of(best, 0.02, 0.005);
  for (std::size_t i = 1; i < fits.size(); ++i) {
    if (same_place(config, fits[i].pose, best.pose)) continue;
    const Pose2 apart = best.pose.inverse() * fits[i].pose;
    const Eigen::Vector3d error(apart.x_m, apart.y_m, apart.yaw_rad);
    if (error.dot(result.information * error) < 9.0) continue;  // along a direction left open
    result.rival = std::max(result.rival, fits[i].score / best.score);
  }
  judge(config, from, to, &result);
  return result;
}

MatchResult align_submaps(const MatchConfig& config, const Submap& from, const Submap& to,
                          const Pose2& T_from_to) {
  MatchResult result;
  result.T_from_to = T_from_to;
  if (from.empty() || to.empty()) {
    result.reason = "nothing was seen at one of the two places";
    return result;
  }
  const Fit fit = refine(from, to, T_from_to);
  result.T_from_to = fit.pose;
  result.score = fit.score;
  result.information = information_of(fit, 0.01, 0.0025);
  judge(config, from, to, &result);
  return result;
}

}  // namespace knav
