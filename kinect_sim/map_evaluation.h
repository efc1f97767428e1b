#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "core/distance_map.h"
#include "core/pose2.h"
#include "core/trajectory.h"
#include "kinect_sim/world.h"

namespace knav {

struct MapEvaluationConfig {
  double slice_low_m = 0.05, slice_high_m = 2.0;  ///< heights that count as wall for the sensor
  double range_m = 8.0;                           ///< a wall nearer than this should be in the map
  double fov_deg = 57.0;
  double match_m = 0.10;  ///< mapped: the contour lies this near
  int sightings = 3;      ///< poses (0.1 m or 0.1 rad apart) that must have seen it
  double camera_forward_m = 0.05;
};

struct MapEvaluation {
  double rmse_m = 0.0, median_m = 0.0, percentile_95_m = 0.0;
  double outlier_fraction = 0.0;  ///< contour farther than 0.3 m from any true surface
  double completeness = 0.0;
  double contour_length_m = 0.0, visible_length_m = 0.0;
  Pose2 T_world_map;  ///< after alignment
  Pose2 T_start_map;  ///< what the alignment changed
  std::vector<Point2> contour_world;
  std::vector<Point2> visible,
      missed;  ///< true surface that was seen, and the part of it that has no contour
};

/// The zero crossings of a signed distance map between neighbouring cells, to a fraction of a cell; map
/// frame.
std::vector<Point2> zero_contour(const DistanceMap& map);

/// Surfaces of a world in a slice of heights.
class TrueSurfaces {
 public:
  TrueSurfaces(const WorldConfig& world, double low_m, double high_m);
  const std::vector<Solid>& solids() const { return solids_; }
  /// Nearest point of any surface within `limit_m`; false if there is none.
  bool nearest(const Point2& p, double limit_m, Point2* on_surface) const;

 private:
  struct Edge {
    Point2 a, b;
  };
  std::vector<Solid> solids_;
  std::vector<Edge> edges_;
  GridGeometry buckets_;
  std::vector<std::vector<std::uint32_t>> bucket_;
};

/// How well a map agrees with the building it was made in.
/// @param truth the true trajectory of the mapping drive, T_world_base; its first pose is the map's origin
MapEvaluation evaluate_map(const DistanceMap& map, const WorldConfig& world, const Trajectory& truth,
                           const MapEvaluationConfig& config);

/// True surfaces grey, contour blue, what was missed red, the trajectory green.
cv::Mat evaluation_picture(const MapEvaluation& evaluation, const WorldConfig& world, const Trajectory& truth,
                           const MapEvaluationConfig& config);

}  // namespace knav
