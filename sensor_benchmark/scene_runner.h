#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/random.h"
#include "sensor_benchmark/sections.h"
#include "sensor_benchmark/simulated_sensor.h"

namespace knav {

constexpr double kCameraForward_m = 0.05, kCameraHeight_m = 0.5;  ///< as TF says

/// How a robot on a real floor sways: pitch and roll in slow waves with a kick at every bump, never more than
/// `largest_deg`; bumps lift it by up to 1 cm. TF knows nothing of it.
class Sway {
 public:
  Sway(double largest_deg, RandomStream* random);
  /// Where the camera's optical frame truly is in the base, whose z = 0 is the floor.
  Eigen::Isometry3d T_base_optical(double t_s) const;

 private:
  double kick(double t_s) const;
  double largest_deg_, pitch_hz_, roll_hz_, pitch_phase_, roll_phase_, bump_phase_s_;
};

/// A robot's way: where base_link is at a time.
using Way = std::function<Pose2(double t_s)>;
/// Straight on, or along an arc.
Way arc(const Pose2& start, double v_mps, double w_radps);

/// One simulated device in a world, its truth, and the front ends under test on the same frames.
class SceneRunner {
 public:
  static constexpr int kOurs = 0, kPaper = 1;
  SceneRunner(const WorldConfig& world, const std::string& preset, int device,
              const SensorBenchmarkOptions& options, Devices* devices);

  struct View {
    Pose2 T_world_base;
    Eigen::Isometry3d T_base_optical;  ///< true, at the stamp
    cv::Mat true_depth_m;              ///< at the stamp, all rows
    std::vector<float> true_z_m;       ///< per column of the levelled camera; NaN: no obstacle
    DepthProfile profile[2];           ///< kOurs, kPaper
  };
  /// The robot at time t_s of its way.
  const View& look(const Way& way, const Sway& sway, double t_s);
  /// Another drive begins: what came before is forgotten.
  void reset();
  const PinholeModel& camera() const { return sensor_.camera(); }
  FrontEnd& front_end(int which) { return which == kOurs ? ours_ : paper_; }
  const cv::Mat& depth_mm() const { return depth_mm_; }

 private:
  SimulatedSensor sensor_;
  FrontEnd ours_, paper_;
  double slice_top_m_;
  Eigen::Isometry3d T_base_optical_by_tf_;
  View view_;
  cv::Mat depth_mm_;
  std::uint64_t frame_ = 0;
};

/// The least and the largest value within `reach` columns of u, NaN left out; NaN if there is none.
float least_near(const std::vector<float>& values, std::size_t u, std::size_t reach);
float largest_near(const std::vector<float>& values, std::size_t u, std::size_t reach);

}  // namespace knav
