#include "openni2_driver/camera_info.h"

#include <cmath>

namespace knav {
namespace {

double focal_px(int pixels, double fov_rad) {
  // Views that no lens of this kind has, 0 and NaN included, count as untold.
  if (!(fov_rad > 0.05 && fov_rad < 3.0)) return 0.0;
  return 0.5 * pixels / std::tan(0.5 * fov_rad);
}

}  // namespace

PinholeModel nominal_model(int width_px, int height_px, double horizontal_fov_rad, double vertical_fov_rad) {
  PinholeModel model;
  model.width_px = width_px;
  model.height_px = height_px;
  model.fx_px = focal_px(width_px, horizontal_fov_rad);
  model.fy_px = focal_px(height_px, vertical_fov_rad);
  if (model.fx_px == 0.0) model.fx_px = model.fy_px > 0.0 ? model.fy_px : 585.0 * width_px / 640.0;
  if (model.fy_px == 0.0) model.fy_px = model.fx_px;
  model.cx_px = 0.5 * (width_px - 1);
  model.cy_px = 0.5 * (height_px - 1);
  return model;
}

}  // namespace knav
