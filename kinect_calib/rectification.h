#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"

namespace knav {

/// A camera as the driver describes it: raw pixels with lens distortion, and the ideal camera to rectify to
/// (camera_info's K, D, R, P).
struct RawCamera {
  PinholeModel raw;                ///< K
  std::vector<double> distortion;  ///< D: plumb_bob (4, 5) or rational_polynomial (8); empty or zeros = none
  PinholeModel rectified;          ///< P

  bool distorted() const;
};

/// Lens rectification by a table that names, for every pixel of the ideal image, the nearest raw pixel.
/// Depths are moved, never blended: a mean of two depths across an edge is a surface that does not exist.
class RectificationTable {
 public:
  /// Does nothing if `camera` is the one already set. False (and an identity table) if the model is not
  /// usable.
  bool set_camera(const RawCamera& camera);
  /// True if raw and rectified image are the same.
  bool identity() const { return identity_; }
  /// Per ideal pixel the index of the raw pixel, -1 if it lies outside the raw image.
  const std::vector<std::int32_t>& source() const { return source_; }

 private:
  RawCamera camera_;
  bool identity_ = true;
  std::vector<std::int32_t> source_;
};

}  // namespace knav
