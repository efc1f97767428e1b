#include "global_map_builder/drive_view.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr std::size_t kMaxBins = 200;       // of a depth camera
constexpr std::size_t kMaxScanBins = 720;   // a scanner's rays are few and good: each counts
constexpr double kNearFrame_s = 0.5;
constexpr int kReach_bins = 5;         // neighbours on either side that a normal is fitted to
constexpr int kMinBins = 5;
/// The same of a scanner, as an angle; and the fewest, for what is short: along a corridor only the faces of door frames and cupboards
/// tell how far the robot came.
constexpr double kScanReach_rad = 1.5 * kPi / 180.0;
constexpr int kMinScanReach_bins = 2, kMaxScanReach_bins = 12;
constexpr double kMinBaseline_m = 0.1, kMinScanBaseline_m = 0.02;  // of a normal
constexpr double kNormal_sd_m = 0.005;   // whatever the angle
constexpr double kRangeMin_m = 0.3, kRangeMax_m = 20.0;
constexpr double kMerge_s = 5.0;         // frames farther apart in time are not averaged
constexpr double kSameSurface_sd = 3.0;  // a reading farther off than so many standard deviations is of another surface

/// Of one frame's reading in a bin.
double noise_sd_m(double depth_m) { return 0.01 + 0.003 * depth_m * depth_m; }

/// Of a reading along its ray. A calibrated Kinect, its profile smoothed over some columns, is wrong by 0.5 % of the
/// range (sd, 2 to 18 m, simulated BRIN building), most of it steadily; noise grows with the range squared.
double range_sd_m(bool depth_camera, double range_m) {
  return depth_camera ? 0.005 + 0.0007 * range_m * range_m : 0.01;
}

}  // namespace

DriveView::DriveView(const JointRefinementConfig& config, const Drive& drive, int keyframe) : far_m_(config.far_m) {
  const Keyframe& k = drive.keyframes[static_cast<std::size_t>(keyframe)];
  const auto after = std::lower_bound(drive.frames.begin(), drive.frames.end(), k.stamp_s,
                                      [](const DriveFrame& f, double s) { return f.stamp_s < s; });
  auto nearest = after;
  if (after == drive.frames.end() ||
      (after != drive.frames.begin() && k.stamp_s - (after - 1)->stamp_s < after->stamp_s - k.stamp_s)) {
    if (after == drive.frames.begin()) return;
    nearest = after - 1;
  }
  if (std::fabs(nearest->stamp_s - k.stamp_s) > kNearFrame_s) return;
  set_sensor(k.T_drive_base.inverse() * nearest->T_drive_base * nearest->T_base_sensor);
  std::visit([&](const auto& data) { fill(data); }, nearest->data);
  if (pinhole_) average(config, drive.frames, static_cast<std::size_t>(nearest - drive.frames.begin()));
  place({});
}

void DriveView::set_sensor(const Pose2& T_keyframe_sensor) {
  T_keyframe_sensor_ = T_keyframe_sensor;
  const double c = std::cos(T_keyframe_sensor.yaw_rad), s = std::sin(T_keyframe_sensor.yaw_rad);
  R_sensor_keyframe_ << c, s, -s, c;
}

void DriveView::fill(const DepthProfile& profile) {
  pinhole_ = true;
  reach_bins_ = kReach_bins;
  fx_px_ = profile.fx_px;
  cx_px_ = profile.cx_px;
  const std::size_t columns = profile.z_m.size(), width = std::max<std::size_t>(1, (columns + kMaxBins - 1) / kMaxBins);
  bin_columns_ = static_cast<double>(width);
  std::vector<float> z;
  for (std::size_t first = 0; first + width <= columns; first += width) {
    ViewPoint& point = points_.emplace_back();
    z.clear();
    for (std::size_t u = first; u < first + width; ++u) {
      // Low and high things look different from every distance; walls do not.
      const bool middle = profile.height_class.size() != columns || profile.height_class[u] == HeightClass::kMiddle;
      if (middle && profile.z_m[u] > 0.0f) z.push_back(profile.z_m[u]);
    }
    const double column = static_cast<double>(first) + 0.5 * (bin_columns_ - 1.0);
    point.column_share = (column + 0.5) / static_cast<double>(columns);
    point.direction = {1.0, -(column - cx_px_) / fx_px_};
    if (2 * z.size() <= width) continue;
    const auto middle = z.begin() + static_cast<std::ptrdiff_t>(z.size() / 2);
    std::nth_element(z.begin(), middle, z.end());
    point.depth_m = static_cast<double>(*middle);
    const double range_m = point.depth_m * point.direction.norm();
    point.valid = range_m > kRangeMin_m && range_m < std::min(kRangeMax_m, profile.range_max_m);
  }
}

/// Every bin becomes the mean of what the frames beside `own` saw in its direction, as seen from `own`: a Kinect's noise is new
/// with every frame, and from so near its steady errors are the same.
void DriveView::average(const JointRefinementConfig& config, const std::vector<DriveFrame>& frames, std::size_t own) {
  struct Reading {
    double depth_m, column_share;
  };
  std::vector<std::vector<Reading>> of_bin(points_.size());
  const DriveFrame& middle = frames[own];
  const Pose2 T_sensor_drive = (middle.T_drive_base * middle.T_base_sensor).inverse();
  std::size_t used = 0;
  DriveView one;
  const auto take = [&](const DriveFrame& frame) {
    const auto* profile = std::get_if<DepthProfile>(&frame.data);
    if (profile == nullptr || std::fabs(frame.path_m - middle.path_m) > config.merge_m ||
        std::fabs(frame.stamp_s - middle.stamp_s) > kMerge_s ||
        std::fabs(normalize_angle_rad(frame.T_drive_base.yaw_rad - middle.T_drive_base.yaw_rad)) >
            config.merge_deg * kPi / 180.0) {
      return false;
    }
    one.points_.clear();
    one.fill(*profile);
    const Pose2 T_middle_sensor = T_sensor_drive * frame.T_drive_base * frame.T_base_sensor;
    for (const ViewPoint& p : one.points_) {
      if (!p.valid) continue;
      const Point2 at = T_middle_sensor * Point2{p.depth_m * p.direction.x(), p.depth_m * p.direction.y()};
      const int bin = bin_at(at);
      if (bin >= 0) of_bin[static_cast<std::size_t>(bin)].push_back({at.x_m, p.column_share});
    }
    ++used;
    return true;
  };
  for (std::size_t i = own; i < frames.size() && take(frames[i]);) ++i;
  for (std::size_t i = own; i > 0 && take(frames[i - 1]);) --i;
  std::vector<double> depth_m;
  for (std::size_t b = 0; b < points_.size(); ++b) {
    const std::vector<Reading>& readings = of_bin[b];
    ViewPoint& point = points_[b];
    point.valid = false;
    if (readings.empty() || 4 * readings.size() < used) continue;
    depth_m.clear();
    for (const Reading& r : readings) depth_m.push_back(r.depth_m);
    const auto half = depth_m.begin() + static_cast<std::ptrdiff_t>(depth_m.size() / 2);
    std::nth_element(depth_m.begin(), half, depth_m.end());
    const double gate_m = kSameSurface_sd * noise_sd_m(*half);
    double sum_m = 0.0, share = 0.0;
    std::size_t count = 0;
    for (const Reading& r : readings) {
      if (std::fabs(r.depth_m - *half) > gate_m) continue;  // beyond an edge
      sum_m += r.depth_m;
      share += r.column_share;
      ++count;
    }
    if (2 * count < readings.size()) continue;
    point.depth_m = sum_m / static_cast<double>(count);
    point.column_share = share / static_cast<double>(count);
    point.valid = point.depth_m * point.direction.norm() < kRangeMax_m;
  }
}

void DriveView::fill(const RangeScan& scan) {
  pinhole_ = false;
  angle_min_rad_ = scan.angle_min_rad;
  angle_increment_rad_ = scan.angle_increment_rad;
  const std::size_t rays = scan.range_m.size(), width = std::max<std::size_t>(1, (rays + kMaxScanBins - 1) / kMaxScanBins);
  bin_columns_ = static_cast<double>(width);
  const double bin_rad = bin_columns_ * std::fabs(scan.angle_increment_rad);
  reach_bins_ = std::clamp(static_cast<int>(std::lround(kScanReach_rad / std::max(bin_rad, 1e-4))), kMinScanReach_bins + 1, kMaxScanReach_bins);
  for (std::size_t first = 0; first + width <= rays; first += width) {
    ViewPoint& point = points_.emplace_back();
    const std::size_t ray = first + width / 2;
    const double angle = scan.angle_min_rad + static_cast<double>(ray) * scan.angle_increment_rad;
    point.column_share = (static_cast<double>(ray) + 0.5) / static_cast<double>(rays);
    point.direction = {std::cos(angle), std::sin(angle)};
    const float r = scan.range_m[ray];
    point.valid = r > kRangeMin_m && r < std::min(kRangeMax_m, scan.range_max_m);  // false for NaN
    if (point.valid) point.depth_m = static_cast<double>(r);
  }
}

void DriveView::place(const RangeOffset& offset) {
  const double c = std::cos(T_keyframe_sensor_.yaw_rad), s = std::sin(T_keyframe_sensor_.yaw_rad);
  Eigen::Matrix2d R;
  R << c, -s, s, c;
  const Eigen::Vector2d t(T_keyframe_sensor_.x_m, T_keyframe_sensor_.y_m);
  for (ViewPoint& p : points_) {
    if (!p.valid) continue;
    const double z = pinhole_ ? offset.corrected_m(p.depth_m, p.column_share) : p.depth_m;
    p.position = t + R * (z * p.direction);
    p.per_offset = pinhole_ ? Eigen::Vector2d(R * (-z * z * p.direction)) : Eigen::Vector2d::Zero();
  }
  find_normals();
}

void DriveView::find_normals() {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    points_[i].straight = false;
    if (!points_[i].valid) continue;
    find_normal(i, reach_bins_);
    if (!pinhole_ && !points_[i].straight) find_normal(i, kMinScanReach_bins);
  }
}

void DriveView::find_normal(std::size_t i, int reach_bins) {
  const auto count = static_cast<int>(points_.size()), at = static_cast<int>(i);
  const Eigen::Vector2d eye(T_keyframe_sensor_.x_m, T_keyframe_sensor_.y_m);
  ViewPoint& p = points_[i];
  const double range_m = (p.position - eye).norm(), sd_m = range_sd_m(pinhole_, range_m);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  int n = 0;
  for (int k = std::max(0, at - reach_bins); k <= std::min(count - 1, at + reach_bins); ++k) {
    const ViewPoint& q = points_[static_cast<std::size_t>(k)];
    if (!q.valid) continue;
    const Eigen::Vector2d d = q.position - p.position;
    sum += d;
    squares += d * d.transpose();
    ++n;
  }
  if (n < kMinBins) return;
  const Eigen::Vector2d mean = sum / n;
  const Eigen::Matrix2d spread = squares / n - mean * mean.transpose();
  // The smaller axis of a 2 x 2 covariance.
  const double half = 0.5 * (spread(0, 0) + spread(1, 1));
  const double root = std::hypot(0.5 * (spread(0, 0) - spread(1, 1)), spread(0, 1));
  const double across = std::max(0.0, half - root), along = half + root;
  const double angle = 0.5 * std::atan2(2.0 * spread(0, 1), spread(0, 0) - spread(1, 1));
  Eigen::Vector2d normal(-std::sin(angle), std::cos(angle));
  const Eigen::Vector2d ray = (p.position - eye) / range_m;
  if (normal.dot(ray) > 0.0) normal = -normal;  // towards the sensor
  p.range_m = range_m;
  p.sd_m = kNormal_sd_m - sd_m * normal.dot(ray);
  if (std::sqrt(along) < (pinhole_ ? kMinBaseline_m : kMinScanBaseline_m) || std::sqrt(across) > p.sd_m ||
      std::fabs(normal.dot(mean)) > 2.0 * p.sd_m || across > 0.1 * along) {
    return;
  }
  // What is steadily wrong with far readings is the same for a whole wall, and grows faster than their noise.
  if (pinhole_) p.sd_m *= 1.0 + range_m * range_m / (far_m_ * far_m_);
  p.normal = normal;
  p.on_line = p.position + mean.dot(normal) * normal;
  p.straight = true;
}

int DriveView::bin_at(const Point2& at) const {
  double column = 0.0;
  if (pinhole_) {
    if (at.x_m < 0.1) return -1;
    column = cx_px_ - fx_px_ * at.y_m / at.x_m;
  } else {
    double angle = std::atan2(at.y_m, at.x_m) - angle_min_rad_;
    angle -= 2.0 * kPi * std::floor(angle / (2.0 * kPi));
    column = angle / angle_increment_rad_;
  }
  const double bin = std::floor((column + 0.5) / bin_columns_);
  return bin >= 0.0 && bin < static_cast<double>(points_.size()) ? static_cast<int>(bin) : -1;
}

}  // namespace knav
