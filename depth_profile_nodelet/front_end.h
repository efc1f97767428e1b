#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/depth_profile.h"
#include "core/pose_buffer.h"
#include "depth_profile_nodelet/floor_remover.h"
#include "depth_profile_nodelet/profile_extractor.h"
#include "depth_profile_nodelet/rolling_shutter.h"
#include "kinect_calib/depth_corrector.h"

namespace knav {

/// The four stages under the names of their nodes, so that one file configures nodelets and programs alike.
struct FrontEndConfig {
  DepthCorrectionConfig depth_correction;
  RollingShutterConfig rolling_shutter;
  FloorRemovalConfig floor_removal;
  DepthProfileConfig depth_profile;

  template <class Visitor>
  void visit(Visitor& v) {
    v.group("depth_correction", depth_correction, "Rectification and depth correction.");
    v.group("rolling_shutter", rolling_shutter, "Row by row turning.");
    v.group("floor_removal", floor_removal, "Floor and slice.");
    v.group("depth_profile", depth_profile, "One depth per column.");
  }
  std::vector<std::string> validate() const;
  /// From the sections of a configuration file (config/*.yaml); an empty path gives the defaults.
  static FrontEndConfig from_file(const std::string& path);
};

/// From a depth image to a depth profile (paper section III.C): the four nodelets' work in one call, for
/// programs. Allocates only when the image size changes.
class FrontEnd {
 public:
  /// UserError if the configuration or the calibration file is not usable.
  explicit FrontEnd(const FrontEndConfig& config);
  /// With this calibration instead of the file's.
  FrontEnd(const FrontEndConfig& config, const DepthCalibration& calibration);

  /// @param depth           16UC1 mm (0 invalid) or 32FC1 m, of the size `camera` says
  /// @param stamp_s         of the row that rolling_shutter/stamp_row_fraction names
  /// @param T_base_optical  the camera's optical frame in the base, whose z = 0 is the floor
  /// @param odometry        may be empty: the rolling shutter stays uncorrected
  /// @return false if the image cannot be used (fault() says why); `out` is then untouched
  bool process(const cv::Mat& depth, const PinholeModel& camera, double stamp_s,
               const Eigen::Isometry3d& T_base_optical, const PoseBuffer& odometry, DepthProfile* out);
  bool process(const cv::Mat& depth, const RawCamera& camera, double stamp_s,
               const Eigen::Isometry3d& T_base_optical, const PoseBuffer& odometry, DepthProfile* out);
  const std::string& fault() const { return corrector_.fault(); }
  /// Forgets the previous floor; after a clock jump.
  void reset() { floor_remover_.reset(); }

  // The stages' results for the newest frame.
  const cv::Mat& rectified() const { return rectified_; }
  const cv::Mat& unrolled() const {
    return unrolled_how_ == RollingShutterCorrector::Outcome::kCorrected ? unrolled_ : rectified_;
  }
  const cv::Mat& sliced() const { return sliced_; }
  const FloorResult& floor() const { return floor_; }
  bool uncalibrated() const { return corrector_.uncalibrated(); }
  RollingShutterCorrector::Outcome rolling_shutter_outcome() const { return unrolled_how_; }

 private:
  FrontEnd(const FrontEndConfig& config, DepthCorrector corrector);
  void process_rectified(const PinholeModel& camera, double stamp_s, const Eigen::Isometry3d& T_base_optical,
                         const PoseBuffer& odometry, DepthProfile* out);

  DepthCorrector corrector_;
  RollingShutterCorrector rolling_shutter_;
  FloorRemover floor_remover_;
  ProfileExtractor extractor_;
  cv::Mat rectified_, unrolled_, sliced_;
  FloorResult floor_;
  RollingShutterCorrector::Outcome unrolled_how_ = RollingShutterCorrector::Outcome::kStill;
};

}  // namespace knav
