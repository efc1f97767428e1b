#pragma once

namespace knav {

/// The Kinect v1's resolution: a disparity code is 1/8 px, so with f = 585 px and a baseline of 0.075 m one
/// code is this much inverse depth [1/m]. A step of depth is then 2.85e-3 z^2: 3 mm at 1 m, 0.29 m at 10
/// m, 1.1 m at 20 m. Noise, its correlations and the systematic offsets are all uniform in inverse depth, so
/// tolerances count in it.
constexpr double kInverseDepthPerCode = 0.125 / (585.0 * 0.075);

/// One code's depth step at depth z [m].
constexpr double depth_step_m(double z_m) { return kInverseDepthPerCode * z_m * z_m; }

}  // namespace knav
