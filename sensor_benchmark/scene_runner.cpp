#include "sensor_benchmark/scene_runner.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr double kBumpPeriod_s = 0.7, kBump_m = 0.01;

Eigen::Isometry3d optical_by(double height_m, double pitch_deg, double roll_deg) {
  return optical_frame(camera_mount({kCameraForward_m, 0.0, height_m}, 0.0, pitch_deg, roll_deg));
}

}  // namespace

Sway::Sway(double largest_deg, RandomStream* random)
    : largest_deg_(largest_deg),
      pitch_hz_(random->uniform(0.2, 0.8)),
      roll_hz_(random->uniform(0.2, 0.8)),
      pitch_phase_(random->uniform(0.0, 2 * kPi)),
      roll_phase_(random->uniform(0.0, 2 * kPi)),
      bump_phase_s_(random->uniform(0.0, kBumpPeriod_s)) {}

/// 0 to 1: a short lift once a period.
double Sway::kick(double t_s) const {
  const double since = std::fmod(t_s + bump_phase_s_, kBumpPeriod_s);
  return since < 0.12 ? std::sin(kPi * since / 0.12) : 0.0;
}

Eigen::Isometry3d Sway::T_base_optical(double t_s) const {
  const double bump = kick(t_s);
  const double pitch = largest_deg_ * (0.8 * std::sin(2 * kPi * pitch_hz_ * t_s + pitch_phase_) - 0.5 * bump);
  const double roll = largest_deg_ * std::sin(2 * kPi * roll_hz_ * t_s + roll_phase_);
  return optical_by(kCameraHeight_m + kBump_m * bump, std::clamp(pitch, -largest_deg_, largest_deg_), roll);
}

Way arc(const Pose2& start, double v_mps, double w_radps) {
  return [=](double t_s) {
    const double turn = w_radps * t_s;
    // sin(x) / x and (1 - cos(x)) / x of the arc
    const double along = std::abs(turn) < 1e-6 ? 1.0 : std::sin(turn) / turn;
    const double aside = std::abs(turn) < 1e-6 ? 0.0 : (1.0 - std::cos(turn)) / turn;
    return start * Pose2{v_mps * t_s * along, v_mps * t_s * aside, turn};
  };
}

SceneRunner::SceneRunner(const WorldConfig& world, const std::string& preset, int device,
                         const SensorBenchmarkOptions& options, Devices* devices)
    : sensor_(world, KinectConfig::preset(preset), devices->seed(device), devices->device_seed(device)),
      ours_(default_front_end(options), devices->calibration(preset, device)),
      paper_(paper_front_end(options), devices->calibration(preset, device)),
      slice_top_m_(default_front_end(options).floor_removal.slice_top_m),
      T_base_optical_by_tf_(optical_by(kCameraHeight_m, 0.0, 0.0)) {}

void SceneRunner::reset() {
  ours_.reset();
  paper_.reset();
}

const SceneRunner::View& SceneRunner::look(const Way& way, const Sway& sway, double t_s) {
  const auto pose = [&](double after_s) {
    return isometry(way(t_s + after_s)) * sway.T_base_optical(t_s + after_s);
  };
  const double stamp_s = 100.0 + t_s;
  sensor_.sense(frame_++, pose, &depth_mm_);
  view_.T_world_base = way(t_s);
  view_.T_base_optical = sway.T_base_optical(t_s);
  sensor_.true_depth(pose(0.0), &view_.true_depth_m);
  true_profile(view_.true_depth_m, camera(), view_.T_base_optical, slice_top_m_, &view_.true_z_m);
  PoseBuffer odometry(32);
  for (int i = -5; i <= 5; ++i) odometry.add(stamp_s + 0.02 * i, way(t_s + 0.02 * i));
  for (const int which : {kOurs, kPaper}) {
    front_end(which).process(depth_mm_, camera(), stamp_s, T_base_optical_by_tf_, odometry,
                             &view_.profile[which]);
  }
  return view_;
}

float least_near(const std::vector<float>& values, std::size_t u, std::size_t reach) {
  float least = std::numeric_limits<float>::quiet_NaN();
  const std::size_t last = std::min(values.size() - 1, u + reach);
  for (std::size_t i = u > reach ? u - reach : 0; i <= last; ++i) least = std::fmin(least, values[i]);
  return least;
}

float largest_near(const std::vector<float>& values, std::size_t u, std::size_t reach) {
  float largest = std::numeric_limits<float>::quiet_NaN();
  const std::size_t last = std::min(values.size() - 1, u + reach);
  for (std::size_t i = u > reach ? u - reach : 0; i <= last; ++i) largest = std::fmax(largest, values[i]);
  return largest;
}

}  // namespace knav
