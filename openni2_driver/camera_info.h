#pragma once

#include "core/camera_model.h"
#include "openni2_driver/sensor_frame.h"

namespace knav {

/// The pinhole a device without calibration claims to be: focal length from its fields of view, principal
/// point in the middle. A view the device does not tell becomes the Kinect's (585 px at 640 columns).
PinholeModel nominal_model(int width_px, int height_px, double horizontal_fov_rad, double vertical_fov_rad);

}  // namespace knav
