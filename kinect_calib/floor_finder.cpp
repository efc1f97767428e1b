#include "kinect_calib/floor_finder.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/pose2.h"
#include "core/random.h"
#include "kinect_calib/kinect_noise.h"

namespace knav {
namespace {

constexpr int kStep_px = 4;
constexpr double kBelowCodes = 6.0;  // so far off is no noise

}  // namespace

Eigen::Matrix3d FloorMount::R_level_camera() const {
  return (Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

// A plane up . p + height = 0 is 1/z = plane . (x, y, 1) with plane = -up / height.
bool FloorFinder::plausible(const Eigen::Vector3d& plane) const {
  const double norm = plane.norm();
  if (!(norm > 1.0 / config_.height_max_m) || !(norm < 1.0 / config_.height_min_m)) return false;
  return plane.y() > norm * std::cos(config_.tilt_max_deg * kPi / 180.0);  // y points down
}

bool FloorFinder::refine(Eigen::Vector3d* plane) const {
  for (int iteration = 0; iteration < 6; ++iteration) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Identity() * 1e-9;
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    int kept = 0;
    for (const Reading& reading : readings_) {
      const Eigen::Vector3d terms(reading.x, reading.y, 1.0);
      if (std::abs(reading.per_m - plane->dot(terms)) > config_.inlier_codes * kInverseDepthPerCode) continue;
      A += terms * terms.transpose();
      b += terms * reading.per_m;
      ++kept;
    }
    if (kept < config_.min_points) return false;
    *plane = A.ldlt().solve(b);
    if (!plausible(*plane)) return false;
  }
  return true;
}

/// A strip of floor says nothing of the tilt across it.
bool FloorFinder::wide_enough(const Eigen::Vector3d& plane, const PinholeModel& camera) const {
  double low_x = 1e9, high_x = -1e9, low_y = 1e9, high_y = -1e9;
  for (const Reading& reading : readings_) {
    const double off = reading.per_m - plane.dot(Eigen::Vector3d(reading.x, reading.y, 1.0));
    if (std::abs(off) > config_.inlier_codes * kInverseDepthPerCode) continue;
    low_x = std::min(low_x, reading.x), high_x = std::max(high_x, reading.x);
    low_y = std::min(low_y, reading.y), high_y = std::max(high_y, reading.y);
  }
  return (high_x - low_x) * camera.fx_px >= config_.min_columns_px &&
         (high_y - low_y) * camera.fy_px >= config_.min_rows_px;
}

bool FloorFinder::find(const cv::Mat& depth, const PinholeModel& camera, std::uint64_t frame_index,
                       FloorMount* mount) {
  readings_.clear();
  for (int v = 0; v < depth.rows; v += kStep_px) {
    const float* row = depth.ptr<float>(v);
    for (int u = 0; u < depth.cols; u += kStep_px) {
      if (!(row[u] > 0.0f && row[u] <= config_.range_max_m)) continue;
      readings_.push_back({(u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px,
                           1.0 / static_cast<double>(row[u])});
    }
  }
  if (readings_.size() < static_cast<std::size_t>(config_.min_points)) return false;

  RandomStream random(config_.seed, random_stream::kFloorSample, frame_index, 0);
  const auto pick = [&] {
    return readings_[static_cast<std::size_t>(random.uniform() * static_cast<double>(readings_.size()))];
  };
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  double best_score = 0.0;
  const double tolerance = config_.inlier_codes * kInverseDepthPerCode;
  for (int sample = 0; sample < config_.samples; ++sample) {
    const Reading a = pick(), b = pick(), c = pick();
    Eigen::Matrix3d A;
    A << a.x, a.y, 1.0, b.x, b.y, 1.0, c.x, c.y, 1.0;
    if (std::abs(A.determinant()) < 1e-3) continue;
    const Eigen::Vector3d plane = A.inverse() * Eigen::Vector3d(a.per_m, b.per_m, c.per_m);
    if (!plausible(plane)) continue;
    double score = 0.0;
    for (const Reading& reading : readings_) {
      const double off = reading.per_m - (plane.x() * reading.x + plane.y() * reading.y + plane.z());
      if (std::abs(off) <= tolerance) {
        score += 1.0;
      } else if (off < -kBelowCodes * kInverseDepthPerCode) {
        score -= 1.0;  // seen through the plane: it is not the floor
      }
    }
    if (score > best_score) best_score = score, best = plane;
  }
  if (best_score < config_.min_points || !refine(&best) || !wide_enough(best, camera)) return false;

  const Eigen::Vector3d up = -best.normalized();
  // In camera axes (x forward, y left, z up) it is the third row of Ry(pitch) Rx(roll).
  const Eigen::Vector3d up_camera(up.z(), -up.x(), -up.y());
  mount->height_m = 1.0 / best.norm();
  mount->pitch_rad = -std::asin(std::clamp(up_camera.x(), -1.0, 1.0));
  mount->roll_rad = std::atan2(up_camera.y(), up_camera.z());
  return true;
}

}  // namespace knav
