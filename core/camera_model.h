#pragma once

namespace knav {

/// A pinhole camera without distortion. Pixel (u, v) with depth z [m] is the optical-frame point
/// (x right, y down, z forward) = ((u - cx) z / fx, (v - cy) z / fy, z).
struct PinholeModel {
  int width_px = 0;
  int height_px = 0;
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;

  bool valid() const { return width_px > 0 && height_px > 0 && fx_px > 0.0 && fy_px > 0.0; }
};

}  // namespace knav
