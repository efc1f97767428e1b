#include "depth_profile_nodelet/rolling_shutter.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/multiversion.h"

namespace knav {
namespace {

/// to[i] /= cos - sin x', the depth seen from the turned camera.
KNAV_MULTIVERSION
void turn_depth(float* to, int width_px, float cosine, float sine_per_fx, float cx_px) {
  for (int i = 0; i < width_px; ++i) to[i] /= cosine - sine_per_fx * (static_cast<float>(i) - cx_px);
}

void shift_row(const float* from, float* to, int width_px, int shift_px) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const int first = std::clamp(shift_px, 0, width_px), last = std::clamp(width_px + shift_px, 0, width_px);
  std::fill(to, to + first, nan);
  for (int i = first; i < last; ++i) to[i] = from[i - shift_px];
  std::fill(to + std::max(first, last), to + width_px, nan);
}

}  // namespace

RollingShutterCorrector::Outcome RollingShutterCorrector::correct(const cv::Mat& depth,
                                                                  const PinholeModel& camera, double stamp_s,
                                                                  const PoseBuffer& odometry,
                                                                  cv::Mat* unrolled) {
  if (config_.method == "off" || config_.readout_s <= 0.0) return Outcome::kStill;
  const double reference_s = stamp_s + config_.time_offset_s;
  Pose2 T_odom_reference;
  if (!look_up(odometry, reference_s, &T_odom_reference)) return Outcome::kNoOdometry;
  row_yaw_rad_.resize(static_cast<std::size_t>(depth.rows));
  double largest_rad = 0.0;
  for (int v = 0; v < depth.rows; ++v) {
    const double fraction = depth.rows > 1 ? static_cast<double>(v) / (depth.rows - 1) : 0.5;
    const double row_s = reference_s + (fraction - config_.stamp_row_fraction) * config_.readout_s;
    Pose2 T_odom_row;
    if (!look_up(odometry, row_s, &T_odom_row)) return Outcome::kNoOdometry;
    const double yaw_rad = normalize_angle_rad(T_odom_row.yaw_rad - T_odom_reference.yaw_rad);
    row_yaw_rad_[static_cast<std::size_t>(v)] = yaw_rad;
    largest_rad = std::max(largest_rad, std::abs(yaw_rad));
  }
  // Below half a pixel at the image's edge nothing would move.
  const double edge = std::max(camera.cx_px, camera.width_px - camera.cx_px) / camera.fx_px;
  if (largest_rad * camera.fx_px * (1.0 + edge * edge) < 0.5) return Outcome::kStill;
  if (largest_rad * edge > 0.5) return Outcome::kNoOdometry;  // 30 rad/s: no robot turns so; odometry jumped

  unrolled->create(depth.rows, depth.cols, CV_32FC1);
  const bool straighten = config_.straighten_edges && config_.method != "paper";
  if (straighten) edges_.start(depth.rows, depth.cols);
  for (int v = 0; v < depth.rows; ++v) {
    const double yaw_rad = row_yaw_rad_[static_cast<std::size_t>(v)];
    const float* from = depth.ptr<float>(v);
    float* to = unrolled->ptr<float>(v);
    if (config_.method == "paper") {
      shift_row(from, to, depth.cols, static_cast<int>(std::lround(-yaw_rad * camera.fx_px)));
      continue;
    }
    // A point ahead moves to the right in a camera that turns left: x_row = (c x + s) / (c - s x), z_row = z
    // (c - s x).
    const double c = std::cos(yaw_rad), s = std::sin(yaw_rad);
    if (warp_.set({c, s, -s, c}, camera.fx_px, camera.cx_px, depth.cols)) {
      warp_.take(from, to);
    } else {
      std::copy(from, from + depth.cols, to);
    }
    turn_depth(to, depth.cols, static_cast<float>(c), static_cast<float>(s / camera.fx_px),
               static_cast<float>(camera.cx_px));
    if (straighten) edges_.add_row(v, to, warp_);
  }
  if (straighten) edges_.finish(unrolled);
  return Outcome::kCorrected;
}

bool RollingShutterCorrector::look_up(const PoseBuffer& odometry, double stamp_s, Pose2* T_odom_base) const {
  return odometry.at(stamp_s, config_.odometry_gap_s, config_.odometry_extrapolation_s, T_odom_base) ==
         PoseBuffer::Lookup::kOk;
}

}  // namespace knav
