#pragma once

#include <cstdint>

#include "core/distance_map.h"
#include "core/pose2.h"
#include "tsdf_localizer/localizer_config.h"
#include "tsdf_localizer/scan_rays.h"

namespace knav {

/// How well the map explains a scan from one pose. The particles' price looks at end points only; here each
/// ray is also followed from the robot to its end.
struct PoseCheck {
  std::uint32_t explained = 0;  ///< ends on a wall of the map, and nothing of the map stands before it
  std::uint32_t in_front = 0;   ///< ends in the map's open space: a person, moved furniture, or a wrong pose
  std::uint32_t through =
      0;  ///< goes through a wall of the map and ends nowhere in particular: a wrong pose, mostly
  std::uint32_t unknown = 0;   ///< ends where the map knows nothing
  double cost = 1.0;           ///< weighted mean price in [0, 1]; a ray through a wall costs 1, or a half if it ends on one
  double support = 1.0;        ///< see support_of(), over all rays
  double fresh_support = 1.0;  ///< the same, over the rays seen just now; 1 if there are too few of them

  std::uint32_t judged() const { return explained + in_front + through; }
  double inlier_fraction() const { return judged() > 0 ? static_cast<double>(explained) / judged() : 0.0; }
};

/// (explained + in_front / 2) / judged: what stands in front of a wall speaks less against a pose than a look
/// through it, so a crowd (all in_front) scores higher than a wrong pose (as much through as in_front). 1 if
/// nothing is judged. Of rays, or of what they count (HealthConfig::full_range_m).
double support_of(double explained, double in_front, double through);

/// @param stands_there true: something besides this scan says that the robot is here, as that it drove here; what the map has in its
/// place has then been taken away (HealthConfig::body_radius_m). A pose that is only tried out lies in a wall if the map says so.
PoseCheck check_pose(const DistanceMap& map, const ScanRays& rays, const Pose2& T_map_base,
                     const MeasurementConfig& measurement, const HealthConfig& health, bool stands_there);

}  // namespace knav
