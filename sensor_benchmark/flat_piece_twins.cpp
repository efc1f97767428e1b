#include "sensor_benchmark/flat_piece_twins.h"

#include <limits>

#include "kinect_calib/kinect_noise.h"
#include "kinect_sim/solid.h"

namespace knav {
namespace {

constexpr float kNothing_m = std::numeric_limits<float>::infinity();

/// As the pieces' planes are given.
void draw(const SensorStatistics::FlatPiece& piece, const PinholeModel& camera, cv::Mat* depth_m) {
  const cv::Rect& window = piece.window;
  for (int v = window.y; v < window.y + window.height; ++v) {
    for (int u = window.x; u < window.x + window.width; ++u) {
      const Eigen::Vector3d ray((u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px, 1.0);
      depth_m->at<float>(v, u) = static_cast<float>(1.0 / (kInverseDepthPerCode * piece.plane.dot(ray)));
    }
  }
}

KinectConfig without_shadow(KinectConfig config) {
  config.shadow = false;  // pieces stand where something else was between them
  return config;
}

}  // namespace

FlatPieceTwins::FlatPieceTwins(KinectConfig kinect, const PinholeModel& camera, std::uint64_t seed,
                               std::uint64_t device_seed)
    : camera_(camera), kinect_(without_shadow(kinect), camera, seed, device_seed) {}

void FlatPieceTwins::sense(const std::vector<SensorStatistics::FlatPiece>& pieces,
                           const std::function<void(const cv::Mat& depth_m)>& visit) {
  std::vector<SensorStatistics::FlatPiece> left = pieces, later;
  cv::Mat true_m(camera_.height_px, camera_.width_px, CV_32FC1), depth_m;
  while (!left.empty()) {
    true_m.setTo(kNothing_m);
    cv::Mat taken(true_m.size(), CV_8UC1, cv::Scalar(0));
    later.clear();
    for (const SensorStatistics::FlatPiece& piece : left) {
      if (cv::countNonZero(taken(piece.window)) > 0) {
        later.push_back(piece);
        continue;
      }
      draw(piece, camera_, &true_m);
      taken(piece.window).setTo(1);
    }
    left.swap(later);
    sense_frame(true_m, &depth_m);
    visit(depth_m);
  }
}

void FlatPieceTwins::sense_frame(const cv::Mat& true_m, cv::Mat* depth_m) {
  const auto width = static_cast<std::size_t>(camera_.width_px);
  std::vector<float> z_m(width), signal(width, static_cast<float>(albedo(Material::kWall)));
  std::vector<std::uint16_t> mm(width);
  depth_m->create(true_m.size(), CV_32FC1);
  kinect_.start_frame(frame_++);
  for (int v = 0; v < true_m.rows; ++v) {
    std::copy_n(true_m.ptr<float>(v), width, z_m.begin());
    kinect_.sense_row(v, {z_m.data(), signal.data()}, mm.data());
    for (std::size_t u = 0; u < width; ++u) {
      depth_m->at<float>(v, static_cast<int>(u)) =
          mm[u] > 0 ? 0.001f * static_cast<float>(mm[u]) : std::numeric_limits<float>::quiet_NaN();
    }
  }
}

}  // namespace knav
