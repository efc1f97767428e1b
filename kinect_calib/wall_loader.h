#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "kinect_calib/depth_calibrator.h"
#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/rectification.h"
#include "ros_common/bag_reader.h"

namespace knav {

struct WallTopics {
  std::string depth = "camera/depth/image_raw", info = "camera/depth/camera_info", range = "range";
  double range_offset_m = 0.0;  ///< added to each range to get the camera's distance
};

/// Frames of walls at known distances, from a folder or a bag, for calibrators. Rectifies, but corrects
/// nothing.
class WallLoader {
 public:
  /// @param camera_info camera_calibration's file; empty: the folder's or the bag's own, or no lens
  WallLoader(const WallTopics& topics, const std::string& camera_info);

  /// Each frame goes to all calibrators. UserError names the file or topic.
  void load(const std::string& source, const std::string& stage,
            const std::vector<DepthCalibrator*>& calibrators);

 private:
  struct RangeReading {
    double stamp_s, range_m;
  };

  void add(const std::string& where, const cv::Mat& raw, double distance_m);
  void load_folder(const std::string& folder, const std::string& stage);
  void load_bag(const std::string& path, const std::string& stage);
  std::vector<RangeReading> read_ranges(const BagReader& bag) const;
  static bool stands_still(const std::vector<RangeReading>& readings, double stamp_s, double* range_m);

  const WallTopics topics_;
  const bool camera_given_;
  DepthCorrector corrector_;
  RawCamera camera_;
  cv::Mat metres_;
  std::vector<DepthCalibrator*> calibrators_;
};

}  // namespace knav
