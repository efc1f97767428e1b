#include "depth_profile_nodelet/floor_plane_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/multiversion.h"
#include "core/pose2.h"
#include "kinect_calib/kinect_noise.h"

namespace knav {
namespace {

constexpr int kBlockRows = 16;
constexpr double kUpright = 0.5;  ///< a surface that rises less than this part of the floor's slope stands

struct RowTerms {
  float row_up, per_fx, cx, up_x, height, inverse_height, y;
  float gate_m, gate_per_m, range_max_m;
};

/// Adds one row to the columns' sums. Residual r = 1/z - q, where q is the reference plane's inverse depth.
KNAV_MULTIVERSION
void add_row(const float* z_m, int width, const RowTerms& terms, float* n, float* y, float* yy, float* r,
             float* yr, float* rr) {
  const RowTerms t = terms;
#pragma GCC ivdep
  for (int u = 0; u < width; ++u) {
    const float z = z_m[u];
    const float up = t.up_x * ((static_cast<float>(u) - t.cx) * t.per_fx) + t.row_up;  // up . ray
    const float height = z * up + t.height;
    const float gate = t.gate_m + t.gate_per_m * z;
    const bool in = (z > 0.0f) & (z <= t.range_max_m) & (height <= gate) & (height >= -gate);
    const float weight = in ? 1.0f : 0.0f;
    const float residual = in ? 1.0f / z + up * t.inverse_height : 0.0f;
    n[u] += weight;
    y[u] += weight * t.y;
    yy[u] += weight * t.y * t.y;
    r[u] += residual;
    yr[u] += residual * t.y;
    rr[u] += residual * residual;
  }
}

/// When a column's readings, given their sums, count as floor.
struct LineTerms {
  float variance_max;     ///< of the readings about their own line
  float slope_max;        ///< of the line against the reference plane's; infinite: any
  float slope_sd_factor;  ///< a slope from few rows is itself uncertain
  float upright_slope;  ///< of the line against the reference plane's, below which it is an upright surface's
};

/// Do the readings lie on a line, and does it rise as the floor's? Without branches, so that it vectorises.
inline bool like_floor(float n, float y, float yy, float r, float yr, float rr, const LineTerms& terms) {
  const float per_n = 1.0f / n, mean_y = y * per_n, mean_r = r * per_n;
  const float var_y = yy * per_n - mean_y * mean_y;
  const float cov = yr * per_n - mean_y * mean_r;
  const float slope = cov / var_y;
  const float var_r = rr * per_n - mean_r * mean_r - slope * cov;
  const float steep = slope < 0.0f ? -slope : slope;
  const float steep_max = terms.slope_max + terms.slope_sd_factor / std::sqrt(n * var_y);
  return (var_y >= 1e-9f) & (var_r <= terms.variance_max) & (steep <= steep_max);
}

/// Do the readings rise so little that they show an upright surface? It says nothing about where the floor
/// is.
inline bool like_upright(float n, float y, float yy, float r, float yr, const LineTerms& terms) {
  const float per_n = 1.0f / n, mean_y = y * per_n, mean_r = r * per_n;
  const float var_y = yy * per_n - mean_y * mean_y;
  return yr * per_n - mean_y * mean_r < terms.upright_slope * var_y;
}

/// A column's sums, by name.
struct SumPointers {
  float *n, *y, *yy, *r, *yr, *rr;
};

/// Adds a block of rows to the columns in which it looks like floor, and clears it. Candidates are the rows
/// that do, or that look like something else that lies.
KNAV_MULTIVERSION
void add_columns(const SumPointers& block, const SumPointers& sums, float* candidates, int width,
                 const LineTerms& line) {
  const LineTerms terms = line;
  const SumPointers b = block, s = sums;
#pragma GCC ivdep
  for (int u = 0; u < width; ++u) {
    const float n = b.n[u], y = b.y[u], yy = b.yy[u], r = b.r[u], yr = b.yr[u], rr = b.rr[u];
    const bool joins = (n >= 4.0f) & like_floor(n, y, yy, r, yr, rr, terms);
    candidates[u] += (joins | !like_upright(n, y, yy, r, yr, terms)) ? n : 0.0f;
    s.n[u] += joins ? n : 0.0f;
    s.y[u] += joins ? y : 0.0f;
    s.yy[u] += joins ? yy : 0.0f;
    s.r[u] += joins ? r : 0.0f;
    s.yr[u] += joins ? yr : 0.0f;
    s.rr[u] += joins ? rr : 0.0f;
    b.n[u] = b.y[u] = b.yy[u] = b.r[u] = b.yr[u] = b.rr[u] = 0.0f;
  }
}

/// Inverse depth is ray . g with g = -up / height.
Eigen::Vector3d gradient_of(const FloorPlane& plane) { return -plane.up / plane.height_m; }

LineTerms line_terms(const FloorFitConfig& config, const FloorPlane& reference) {
  const auto noise = static_cast<float>(config.noise_codes * kInverseDepthPerCode);
  if (config.method == "paper") {
    const float any = std::numeric_limits<float>::infinity();
    return {noise * noise, any, 0.0f, -any};
  }
  // The inverse depth of a floor rises by 1 / height per unit of y; a wall's does not rise at all.
  const double steepness = std::abs(gradient_of(reference).y());
  return {noise * noise,
          static_cast<float>(steepness * (config.height_tolerance_m / reference.height_m + 0.15)),
          static_cast<float>(2.0 * kInverseDepthPerCode), static_cast<float>(-kUpright * steepness)};
}

FloorPlane plane_of(const Eigen::Vector3d& gradient) {
  FloorPlane plane;
  plane.height_m = 1.0 / gradient.norm();
  plane.up = -gradient * plane.height_m;
  return plane;
}

}  // namespace

FloorPlane FloorPlane::from_mount(const Eigen::Isometry3d& T_base_optical) {
  return {T_base_optical.linear().transpose() * Eigen::Vector3d::UnitZ(), T_base_optical.translation().z()};
}

void FloorPlaneFit::Sums::reset(int width) {
  for (auto* sum : {&n, &y, &yy, &r, &yr, &rr}) sum->assign(static_cast<std::size_t>(width), 0.0f);
}

FloorPlaneFit::Result FloorPlaneFit::fit(const cv::Mat& depth, const PinholeModel& camera, double stamp_s,
                                         const Eigen::Isometry3d& T_base_optical) {
  Result result;
  const FloorPlane mount = FloorPlane::from_mount(T_base_optical);
  result.plane = mount;
  if (config_.method == "mount" || mount.height_m <= 0.05) return result;
  if (fit_frame(depth, camera, mount, &result)) {
    result.source = FloorSource::kFrame;
    previous_base_.up = T_base_optical.linear() * result.plane.up;
    previous_base_.height_m = result.plane.height_m - previous_base_.up.dot(T_base_optical.translation());
    previous_stamp_s_ = stamp_s;
    has_previous_ = true;
    return result;
  }
  const double age_s = stamp_s - previous_stamp_s_;
  const bool fresh = config_.method == "paper" || (age_s >= 0.0 && age_s <= config_.previous_timeout_s);
  if (has_previous_ && fresh) {
    result.plane.up = T_base_optical.linear().transpose() * previous_base_.up;
    result.plane.height_m = previous_base_.height_m + previous_base_.up.dot(T_base_optical.translation());
    result.source = FloorSource::kPrevious;
  } else {
    result.plane = mount;
    result.source = FloorSource::kMount;
  }
  return result;
}

bool FloorPlaneFit::fit_frame(const cv::Mat& depth, const PinholeModel& camera, const FloorPlane& mount,
                              Result* result) {
  const bool paper = config_.method == "paper";
  const double tilt_per_m = std::tan(config_.tilt_tolerance_deg * kPi / 180.0);
  accumulate(depth, camera, mount, config_.height_tolerance_m, tilt_per_m);
  int heard = 0;
  const int agreed = vote(camera, mount, &heard);
  result->vote_fraction = heard > 0 ? static_cast<double>(agreed) / heard : 0.0;
  // What fails the vote is no floor but does not hide it either: the columns that agree with each other and
  // with the mount need no more than half. The paper's have nothing but their number.
  const double majority = paper ? config_.paper_majority : config_.majority;
  if (agreed < config_.min_columns || result->vote_fraction < majority) return false;
  FloorPlane plane;
  if (!solve(camera, mount, &plane)) return false;
  if (!paper) {
    // Once more with every reading near the plane found, and none that is not floor.
    const double noise_per_m = config_.noise_codes * kInverseDepthPerCode;
    accumulate(depth, camera, plane, 0.01, 3.0 * noise_per_m * plane.height_m);
    FloorPlane refined;
    if (!solve(camera, plane, &refined)) return false;
    plane = refined;
    const double cosine = std::clamp(plane.up.dot(mount.up), -1.0, 1.0);
    if (std::acos(cosine) * 180.0 / kPi > config_.tilt_tolerance_deg) return false;
    if (std::abs(plane.height_m - mount.height_m) > config_.height_tolerance_m) return false;
  }
  result->plane = plane;
  return true;
}

void FloorPlaneFit::accumulate(const cv::Mat& depth, const PinholeModel& camera, const FloorPlane& reference,
                               double gate_m, double gate_per_m) {
  sums_.reset(depth.cols);
  block_.reset(depth.cols);
  candidates_.assign(static_cast<std::size_t>(depth.cols), 0.0f);
  const bool paper = config_.method == "paper";
  const double far_m = paper ? 20.0 : config_.range_max_m;
  const double edge = std::max(camera.cx_px, camera.width_px - camera.cx_px) / camera.fx_px;
  RowTerms terms{};
  terms.per_fx = static_cast<float>(1.0 / camera.fx_px);
  terms.cx = static_cast<float>(camera.cx_px);
  terms.up_x = static_cast<float>(reference.up.x());
  terms.height = static_cast<float>(paper ? 0.0 : reference.height_m);
  terms.inverse_height = static_cast<float>(paper ? 0.0 : 1.0 / reference.height_m);
  terms.gate_m = static_cast<float>(paper ? 1e9 : gate_m);
  terms.gate_per_m = static_cast<float>(gate_per_m);
  terms.range_max_m = static_cast<float>(far_m);
  int rows_in_block = 0;
  for (int v = depth.rows - 1; v >= 0; --v) {
    const double y = (v - camera.cy_px) / camera.fy_px;
    const double up = reference.up.y() * y + reference.up.z();
    const bool outside =
        paper ? v < depth.rows - config_.paper_rows
              // No candidate can lie in this row.
              : up - std::abs(reference.up.x()) * edge > (gate_m - reference.height_m) / far_m + gate_per_m;
    if (outside) continue;
    terms.row_up = static_cast<float>(up);
    terms.y = static_cast<float>(y);
    add_row(depth.ptr<float>(v), depth.cols, terms, block_.n.data(), block_.y.data(), block_.yy.data(),
            block_.r.data(), block_.yr.data(), block_.rr.data());
    if (!paper && ++rows_in_block == kBlockRows) {
      add_block(reference);
      rows_in_block = 0;
    }
  }
  add_block(reference);
}

/// The rows up to where a wall stands are floor, the wall's foot is within the gate too: so readings are
/// judged by blocks of rows, and only blocks that rise like a floor join their column's sums.
void FloorPlaneFit::add_block(const FloorPlane& reference) {
  const auto pointers = [](Sums& sums) {
    return SumPointers{sums.n.data(), sums.y.data(),  sums.yy.data(),
                       sums.r.data(), sums.yr.data(), sums.rr.data()};
  };
  add_columns(pointers(block_), pointers(sums_), candidates_.data(), static_cast<int>(sums_.n.size()),
              line_terms(config_, reference));
}

int FloorPlaneFit::vote(const PinholeModel& camera, const FloorPlane& reference, int* heard) {
  const std::size_t width = sums_.n.size();
  votes_.assign(width, 0);
  const bool paper = config_.method == "paper";
  const int rows = paper ? std::max(config_.min_rows, config_.paper_rows / 2) : config_.min_rows;
  const LineTerms line = line_terms(config_, reference);
  int agreed = 0;
  *heard = 0;
  for (std::size_t u = 0; u < width; ++u) {
    if (candidates_[u] < static_cast<float>(rows)) continue;
    ++*heard;
    if (sums_.n[u] < static_cast<float>(rows)) continue;
    if (!like_floor(sums_.n[u], sums_.y[u], sums_.yy[u], sums_.r[u], sums_.yr[u], sums_.rr[u], line))
      continue;
    votes_[u] = 1;
    ++agreed;
  }
  if (paper) return agreed;
  const double noise_per_m = config_.noise_codes * kInverseDepthPerCode;
  // The columns must agree with each other: those off the joint plane (a low platform's) are put out twice
  // over.
  for (int round = 0; round < 2 && agreed >= config_.min_columns; ++round) {
    FloorPlane plane;
    if (!solve(camera, reference, &plane)) return 0;
    const Eigen::Vector3d change = gradient_of(plane) - gradient_of(reference);
    agreed = 0;
    for (std::size_t u = 0; u < width; ++u) {
      if (votes_[u] == 0) continue;
      const double n = sums_.n[u], x = (static_cast<double>(u) - camera.cx_px) / camera.fx_px;
      const double expected = change.z() + change.y() * sums_.y[u] / n + change.x() * x;
      if (std::abs(sums_.r[u] / n - expected) > noise_per_m * (round == 0 ? 3.0 : 2.0)) {
        votes_[u] = 0;
      } else {
        ++agreed;
      }
    }
  }
  return agreed;
}

bool FloorPlaneFit::solve(const PinholeModel& camera, const FloorPlane& reference, FloorPlane* plane) const {
  const bool paper = config_.method == "paper";
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();  // unknowns: changes of the gradient's x, y, z
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (std::size_t u = 0; u < sums_.n.size(); ++u) {
    if (votes_[u] == 0) continue;
    const double x = (static_cast<double>(u) - camera.cx_px) / camera.fx_px;
    const double n = sums_.n[u], y = sums_.y[u], r = sums_.r[u];
    A(0, 0) += n * x * x;
    A(0, 1) += y * x;
    A(0, 2) += n * x;
    A(1, 1) += sums_.yy[u];
    A(1, 2) += y;
    A(2, 2) += n;
    b += Eigen::Vector3d(x * r, sums_.yr[u], r);
  }
  A.triangularView<Eigen::StrictlyLower>() = A.transpose();
  // Where few columns see floor, what they leave open stays with the mount.
  const double prior = std::pow(kInverseDepthPerCode / 0.05, 2);
  A.diagonal().array() += prior;
  const Eigen::LDLT<Eigen::Matrix3d> solver(A);
  if (solver.info() != Eigen::Success) return false;
  const Eigen::Vector3d change = solver.solve(b);
  const Eigen::Vector3d gradient =
      (paper ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : gradient_of(reference)) + change;
  if (!gradient.allFinite() || gradient.norm() < 1e-3) return false;
  *plane = plane_of(gradient);
  return true;
}

}  // namespace knav
