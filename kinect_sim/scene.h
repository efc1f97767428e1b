#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Core>
#include <vector>

#include "kinect_sim/mesh.h"

namespace knav {

/// A world for single rays, by Embree: the LIDAR, the perfect scan, and the truth that depth images are
/// tested against. One thread at a time.
class Scene {
 public:
  explicit Scene(const WorldMeshes& meshes);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// Moves people, doors and timed pieces.
  void update(const DynamicState& state);
  /// How many times the direction's length to the first thing; +Inf if there is none up to `limit`.
  float cast(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float limit) const;

 private:
  void add_instance(const Mesh& mesh);
  void place(std::size_t instance, const Pose2& pose);

  const WorldMeshes* meshes_;
  RTCDevice device_ = nullptr;
  RTCScene top_ = nullptr;
  std::vector<RTCScene> parts_;
  std::vector<RTCGeometry> instances_;
  std::vector<Pose2> pose_;
  std::vector<char> present_;
};

}  // namespace knav
