#include "depth_profile_nodelet/front_end.h"

#include "core/config.h"
#include "core/config_sections.h"

namespace knav {

std::vector<std::string> FrontEndConfig::validate() const {
  std::vector<std::string> faults;
  const auto add = [&](const char* group, const std::vector<std::string>& of_group) {
    for (const std::string& fault : of_group) faults.push_back(std::string(group) + ": " + fault);
  };
  add("depth_correction", depth_correction.validate());
  add("rolling_shutter", rolling_shutter.validate());
  add("floor_removal", floor_removal.validate());
  add("depth_profile", depth_profile.validate());
  return faults;
}

FrontEndConfig FrontEndConfig::from_file(const std::string& path) {
  refuse_unknown_sections(path);
  FrontEndConfig config;
  config.depth_correction = read_config_section<DepthCorrectionConfig>(path, "depth_correction");
  config.rolling_shutter = read_config_section<RollingShutterConfig>(path, "rolling_shutter");
  config.floor_removal = read_config_section<FloorRemovalConfig>(path, "floor_removal");
  config.depth_profile = read_config_section<DepthProfileConfig>(path, "depth_profile");
  return config;
}

FrontEnd::FrontEnd(const FrontEndConfig& config)
    : FrontEnd(config, DepthCorrector(config.depth_correction)) {}

FrontEnd::FrontEnd(const FrontEndConfig& config, const DepthCalibration& calibration)
    : FrontEnd(config, DepthCorrector(config.depth_correction, calibration)) {}

FrontEnd::FrontEnd(const FrontEndConfig& config, DepthCorrector corrector)
    : corrector_(std::move(corrector)),
      rolling_shutter_(config.rolling_shutter),
      floor_remover_(config.floor_removal),
      extractor_(config.depth_profile) {
  const std::vector<std::string> faults = config.validate();
  if (!faults.empty()) throw_faults(faults);
}

bool FrontEnd::process(const cv::Mat& depth, const PinholeModel& camera, double stamp_s,
                       const Eigen::Isometry3d& T_base_optical, const PoseBuffer& odometry,
                       DepthProfile* out) {
  if (!corrector_.correct(depth, camera, &rectified_)) return false;
  process_rectified(camera, stamp_s, T_base_optical, odometry, out);
  return true;
}

bool FrontEnd::process(const cv::Mat& depth, const RawCamera& camera, double stamp_s,
                       const Eigen::Isometry3d& T_base_optical, const PoseBuffer& odometry,
                       DepthProfile* out) {
  if (!corrector_.correct(depth, camera, &rectified_)) return false;
  process_rectified(camera.rectified, stamp_s, T_base_optical, odometry, out);
  return true;
}

void FrontEnd::process_rectified(const PinholeModel& camera, double stamp_s,
                                 const Eigen::Isometry3d& T_base_optical, const PoseBuffer& odometry,
                                 DepthProfile* out) {
  unrolled_how_ = rolling_shutter_.correct(rectified_, camera, stamp_s, odometry, &unrolled_);
  floor_remover_.process(unrolled(), camera, stamp_s, T_base_optical, &sliced_, &floor_);
  extractor_.extract(sliced_, camera, stamp_s, floor_.plane.height_m, floor_.free_from_m, floor_.free_to_m,
                     floor_.height_class, out, &floor_remover_.surface());
}

}  // namespace knav
