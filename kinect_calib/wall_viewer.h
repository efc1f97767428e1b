#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "kinect_calib/wall_plane.h"
#include "kinect_calib/wall_tiles.h"

namespace knav {

/// What the middle of a depth image says of the wall before the camera.
struct SeenWall {
  WallPlane plane;
  double on_wall = 0.0;          ///< share of the middle's tiles that lie on the plane
  double off_wall = 0.0;         ///< share of those above the floor that answer and do not
  double deviation_codes = 0.0;  ///< rms of the wall's tiles about the plane
  std::string fault;             ///< empty, or why this is no wall to calibrate by and what to do
};

/// Looks for the wall that a calibration needs, without being told its distance. The plane is the one that
/// the deviation from the mean is least from (paper section III.B): its slope across the image is how far the
/// robot is from square.
class WallViewer {
 public:
  explicit WallViewer(const PinholeModel& camera);
  /// @param depth_m 32FC1 m, NaN invalid, lens rectified
  const SeenWall& look(const cv::Mat& depth_m);

 private:
  bool is_on_wall(std::size_t tile) const;
  int first_floor_row() const;

  WallTiles tiles_;
  std::vector<char> in_middle_;
  int middle_count_ = 0;
  std::vector<double> middle_per_m_, values_;
  SeenWall view_;
};

}  // namespace knav
