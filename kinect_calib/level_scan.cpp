#include "kinect_calib/level_scan.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "kinect_calib/kinect_noise.h"
#include "kinect_calib/wall_tiles.h"

namespace knav {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr int kStep_px = 2, kBand_px = 20;           // every second pixel of 20 rows up and down
constexpr double kLowest_m = 0.1, kHighest_m = 1.8;  // above the floor
constexpr double kFarthest_m = 6.0, kNearest_m = 0.4;
constexpr int kLineColumns = 7;     // each side
constexpr double kLineCodes = 1.2;  // a wall is no rougher
constexpr int kMinColumns = 60;
constexpr double kCorrelatedColumns = 4.0;  // noise is alike over 8 px
constexpr double kKeyYaw_rad = 12.0 * kPi / 180.0, kKeyDistance_m = 0.8;

void fit_lines(LevelScan* scan) {
  const int n = static_cast<int>(scan->slope.size());
  scan->line_at.assign(scan->slope.size(), kNaN);
  scan->line_per_slope.assign(scan->slope.size(), kNaN);
  for (int i = kLineColumns; i + kLineColumns < n; ++i) {
    double s = 0, q = 0, ss = 0, sq = 0;
    constexpr double count = 2 * kLineColumns + 1;
    const double s0 = scan->slope[static_cast<std::size_t>(i)];
    for (int j = i - kLineColumns; j <= i + kLineColumns; ++j) {
      const double ds = scan->slope[static_cast<std::size_t>(j)] - s0,
                   value = scan->per_m[static_cast<std::size_t>(j)];
      s += ds, q += value, ss += ds * ds, sq += ds * value;
    }
    const double determinant = count * ss - s * s;
    if (!(determinant > 1e-9)) continue;  // also where a value is NaN
    const double per_slope = (count * sq - s * q) / determinant, at = (q - per_slope * s) / count;
    double worst = 0.0;
    for (int j = i - kLineColumns; j <= i + kLineColumns; ++j) {
      const double ds = scan->slope[static_cast<std::size_t>(j)] - s0;
      worst = std::max(worst, std::abs(scan->per_m[static_cast<std::size_t>(j)] - at - per_slope * ds));
    }
    if (!(worst <= kLineCodes * kInverseDepthPerCode)) continue;
    scan->line_at[static_cast<std::size_t>(i)] = at - per_slope * s0;
    scan->line_per_slope[static_cast<std::size_t>(i)] = per_slope;
  }
}

}  // namespace

void make_level_scan(const cv::Mat& depth, const PinholeModel& camera, const FloorMount& mount,
                     const ReadoutTiming& timing, double stamp_s, LevelScan* scan) {
  const Eigen::Matrix3d R = mount.R_level_camera();
  const double horizon = camera.cy_px - camera.fy_px * std::tan(mount.pitch_rad);
  const int middle = static_cast<int>(std::clamp(horizon, 1.0 * kBand_px, depth.rows - 1.0 - kBand_px));
  scan->stamp_s = stamp_s + (static_cast<double>(middle) / (depth.rows - 1) - timing.stamp_row_fraction) *
                                timing.readout_s;
  scan->slope.clear();
  scan->per_m.clear();
  std::vector<double> per_m, slope, sorted;
  for (int u = 0; u < depth.cols; u += kStep_px) {
    per_m.clear();
    slope.clear();
    for (int v = middle - kBand_px; v <= middle + kBand_px; v += kStep_px) {
      if (v < 0 || v >= depth.rows) continue;
      const double z = depth.at<float>(v, u);
      if (!(z > kNearest_m && z < kFarthest_m)) continue;
      const Eigen::Vector3d level = R * Eigen::Vector3d(z, -(u - camera.cx_px) / camera.fx_px * z,
                                                        -(v - camera.cy_px) / camera.fy_px * z);
      const double height_m = mount.height_m + level.z();
      if (height_m < kLowest_m || height_m > kHighest_m || level.x() < kNearest_m) continue;
      per_m.push_back(1.0 / level.x());
      slope.push_back(level.y() / level.x());
    }
    // The mean near the median: a median alone is rounded to whole codes.
    double sum_q = 0.0, sum_s = 0.0, count = 0.0;
    if (per_m.size() >= 8) {
      sorted = per_m;
      const double median = median_of(&sorted);
      for (std::size_t i = 0; i < per_m.size(); ++i) {
        if (std::abs(per_m[i] - median) > 4.0 * kInverseDepthPerCode) continue;
        sum_q += per_m[i], sum_s += slope[i], count += 1.0;
      }
    }
    const bool seen = count >= 6.0;
    scan->per_m.push_back(seen ? sum_q / count : kNaN);
    // Columns look to the right as u grows: slopes fall.
    scan->slope.push_back(seen ? sum_s / count : -(u - camera.cx_px) / camera.fx_px);
  }
  std::reverse(scan->per_m.begin(), scan->per_m.end());
  std::reverse(scan->slope.begin(), scan->slope.end());
  fit_lines(scan);
}

bool align_scans(const LevelScan& from, const LevelScan& to, ScanMotion* motion) {
  motion->from_s = from.stamp_s;
  motion->to_s = to.stamp_s;
  motion->columns = 0;
  std::vector<double> sizes;
  double gate = 12.0 * kInverseDepthPerCode;
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    double cost = 0.0;
    int kept = 0, overlap = 0;
    sizes.clear();
    const double c = std::cos(motion->T_from_to.yaw_rad), s = std::sin(motion->T_from_to.yaw_rad);
    for (std::size_t i = 0; i < to.slope.size(); ++i) {
      if (std::isnan(to.per_m[i])) continue;
      const double forward = 1.0 / to.per_m[i], left = to.slope[i] / to.per_m[i];
      const double f = c * forward - s * left + motion->T_from_to.x_m;
      const double l = s * forward + c * left + motion->T_from_to.y_m;
      if (f < kNearest_m) continue;
      const double slope = l / f;
      const auto at = std::lower_bound(from.slope.begin(), from.slope.end(), slope);
      if (at == from.slope.begin() || at == from.slope.end()) continue;
      auto j = static_cast<std::size_t>(at - from.slope.begin());
      if (slope - from.slope[j - 1] < from.slope[j] - slope) --j;
      if (std::isnan(from.line_at[j])) continue;
      ++overlap;
      const double residual = from.line_at[j] + from.line_per_slope[j] * slope - 1.0 / f;
      if (std::abs(residual) > gate) continue;
      const double df = (1.0 - from.line_per_slope[j] * l) / (f * f), dl = from.line_per_slope[j] / f;
      const Eigen::Vector3d J(df, dl, -df * (l - motion->T_from_to.y_m) + dl * (f - motion->T_from_to.x_m));
      A += J * J.transpose();
      b += J * residual;
      cost += residual * residual;
      sizes.push_back(std::abs(residual));
      ++kept;
    }
    if (kept < kMinColumns || 2 * kept < overlap) return false;
    // The damping holds what nothing tells (along a corridor) where it was; it is nothing beside a real wall.
    const Eigen::Vector3d step =
        -(A + Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal().toDenseMatrix()).ldlt().solve(b);
    if (!step.allFinite() || step.head<2>().norm() > 0.5 || std::abs(step[2]) > 0.5) return false;
    motion->T_from_to.x_m += step[0];
    motion->T_from_to.y_m += step[1];
    motion->T_from_to.yaw_rad = normalize_angle_rad(motion->T_from_to.yaw_rad + step[2]);
    const double typical = 1.4826 * median_of(&sizes);
    gate = std::clamp(3.0 * typical, 2.0 * kInverseDepthPerCode, 12.0 * kInverseDepthPerCode);
    motion->columns = kept;
    const double variance =
        std::max(cost / kept, 0.01 * kInverseDepthPerCode * kInverseDepthPerCode) * kCorrelatedColumns;
    motion->information = A / variance;
    if (iteration > 4 && step.head<2>().norm() < 1e-5 && std::abs(step[2]) < 1e-5) break;
  }
  return true;
}

bool ScanOdometry::add(const LevelScan& scan, ScanMotion* motion) {
  if (!any_) {
    any_ = true;
    key_ = scan;
    T_key_previous_ = T_step_ = Pose2{};
    return false;
  }
  motion->T_from_to = T_key_previous_ * T_step_;
  if (!align_scans(key_, scan, motion)) {
    // The key is out of sight, or something is in the way: begin again.
    key_ = scan;
    T_key_previous_ = T_step_ = Pose2{};
    return false;
  }
  T_step_ = T_key_previous_.inverse() * motion->T_from_to;
  T_key_previous_ = motion->T_from_to;
  if (std::abs(T_key_previous_.yaw_rad) > kKeyYaw_rad ||
      std::hypot(T_key_previous_.x_m, T_key_previous_.y_m) > kKeyDistance_m) {
    key_ = scan;
    T_key_previous_ = Pose2{};
  }
  return true;
}

}  // namespace knav
