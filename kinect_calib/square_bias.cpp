#include "kinect_calib/square_bias.h"

#include <Eigen/Dense>
#include <cmath>

namespace knav {
namespace {

// Beforehand: a finder mounted by eye and by hand; slants as the simulator's devices have them, 0.003 at
// most.
constexpr double kBeamSd_rad = 0.01, kLeverSd_m = 0.03, kSlantSd_radpm = 0.004;
// Of a side's range: the finder's 2 mm over 16 readings, and the pivot that moves while the base turns. Of a
// side's yaw: bands.
constexpr double kRangeSd_m = 0.001, kYawSd_rad = 0.0007;

}  // namespace

void SquareBias::add(const Swing& swing) {
  swings_.push_back(swing);
  Eigen::Matrix3d A =
      Eigen::Vector3d(std::pow(kBeamSd_rad, -2), std::pow(kLeverSd_m, -2), std::pow(kSlantSd_radpm, -2))
          .asDiagonal();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const Swing& s : swings_) {
    // range cos(yaw + off) is the same to both sides; off is small.
    const double across_m =
        s.left_range_m * std::sin(s.left_yaw_rad) - s.right_range_m * std::sin(s.right_yaw_rad);
    const double off_rad =
        (s.left_range_m * std::cos(s.left_yaw_rad) - s.right_range_m * std::cos(s.right_yaw_rad)) / across_m;
    const double sd_rad = std::hypot(std::sqrt(2.0) * kRangeSd_m / across_m, kYawSd_rad);
    const Eigen::Vector3d terms(1.0, 1.0 / s.distance_m, -s.distance_m);
    A += terms * terms.transpose() / (sd_rad * sd_rad);
    b += terms * off_rad / (sd_rad * sd_rad);
  }
  slant_radpm_ = A.ldlt().solve(b)[2];
}

}  // namespace knav
