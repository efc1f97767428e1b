#pragma once

#include <vector>

namespace knav {

/// The robot turned to both sides of where the wall seems square, and what the range finder says there.
struct Swing {
  double distance_m = 0.0;                        ///< of the wall, square
  double left_yaw_rad = 0.0, left_range_m = 0.0;  ///< as the depth image's plane says; positive: looks left
  double right_yaw_rad = 0.0, right_range_m = 0.0;
};

/// Where a wall that is square seems to stand. A device whose disparity error is slanted across the image
/// sees a square wall turned, the more the farther off, and a robot that turns square by such an image hides
/// the slant from the calibration. The range finder knows better: to both sides of square it must read the
/// same.
///
/// In a swing it seems symmetric about a heading that departs from the plane's by beam + lever / distance -
/// slant distance: a beam not parallel to the camera, a finder beside the robot's axis, and the device. They
/// are told apart over distances.
class SquareBias {
 public:
  void add(const Swing& swing);
  /// Yaw [rad] that a square wall's plane shows; 0 before anything is known.
  double apparent_yaw_rad(double distance_m) const { return slant_radpm_ * distance_m; }
  double slant_radpm() const { return slant_radpm_; }

 private:
  std::vector<Swing> swings_;
  double slant_radpm_ = 0.0;
};

}  // namespace knav
