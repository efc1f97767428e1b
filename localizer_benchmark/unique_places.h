#pragma once

#include <vector>

#include "core/distance_map.h"
#include "localizer_benchmark/scan_recording.h"
#include "tsdf_localizer/price_field.h"

namespace knav {

/// What a faultless camera of 57 degrees would see within 8 m in the first seconds after a frame, as points in the frame of the
/// robot's true pose there.
std::vector<Point2> true_view(const ProfileRecording& drive, std::size_t frame, double seconds);

/// Whether a view fits one place of a map only, by trying every place and heading: all free places 0.2 m apart x 72 headings,
/// whatever comes near refined to 2.5 cm. It fits where nine in ten of its points lie within 0.2 m of a surface. No part of the
/// localizer has a say in it.
class UniquePlaces {
 public:
  explicit UniquePlaces(const DistanceMap& map);
  /// @param T_map_view the true pose
  /// @param other      a place that it fits as well, if there is one
  bool unique(const std::vector<Point2>& view, const Pose2& T_map_view, Pose2* other) const;
  /// Share of the points that lie on a surface.
  double fit(const std::vector<Point2>& view, const Pose2& T_map_view) const;

 private:
  double refined_fit(const WeightedPoints& points, Pose2* pose) const;

  PriceField near_, nearer_;  ///< 0 within some distance of a surface, 1 elsewhere
  std::vector<Point2> positions_;
};

}  // namespace knav
