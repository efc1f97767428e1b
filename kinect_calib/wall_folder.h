#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "kinect_calib/rectification.h"

namespace knav {

/// One depth image of a wall, by file.
struct WallFrame {
  std::string file;
  double distance_m = 0.0;
};

/// distances.csv of a folder, lines `file,distance_m`. UserError names file and line.
std::vector<WallFrame> read_distances(const std::string& folder);

/// A file as camera_calibration writes it.
RawCamera read_camera_info(const std::string& path);

/// A folder of walls that grows by one distance at a time, and holds whole distances only whatever happens:
/// images first, then distances.csv, each beside and renamed.
class WallFolder {
 public:
  static constexpr const char* kDistances = "distances.csv";
  static constexpr const char* kCamera = "camera_info.yaml";

  /// @param resume go on with what is there; else UserError if there is something
  WallFolder(const std::string& path, bool resume);

  const std::string& path() const { return path_; }
  /// Finished distances, in the order in which they were added.
  std::vector<double> distances_m() const;
  /// Notes the camera; UserError if the folder's images are of another.
  void set_camera(const RawCamera& camera, const std::string& name);
  /// @param frames 16UC1 mm, 0 invalid, as the sensor gave them
  void add(const std::vector<cv::Mat>& frames, double distance_m);

 private:
  std::string path_;
  std::vector<WallFrame> frames_;
};

}  // namespace knav
