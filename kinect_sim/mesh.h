#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "kinect_sim/people.h"
#include "kinect_sim/world.h"

namespace knav {

/// A flat convex face, counter-clockwise as seen from outside.
struct Face {
  std::uint32_t first = 0, count = 0;  ///< its vertices
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  float albedo = 0.0f;
  bool diffuse_all_round = false;  ///< clothes: as bright from all sides
};

/// Something rigid, in its own frame.
struct Mesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Face> faces;
  void add_face(const std::vector<Eigen::Vector3f>& corners, Material material);
  void add(const Solid& solid);
};

/// All that a camera or a laser sees of a world, in rigid pieces: the building, then people, doors, timed
/// pieces. Glass is not among it.
class WorldMeshes {
 public:
  explicit WorldMeshes(const WorldConfig& world);
  const std::vector<Mesh>& meshes() const { return meshes_; }
  /// Where piece i is; false if it is away.
  bool pose(std::size_t i, const DynamicState& state, Pose2* T_world_piece) const;

 private:
  std::vector<Mesh> meshes_;
  std::size_t first_door_ = 0, first_timed_ = 0;
  std::vector<Pose2> T_world_hinge_;
};

}  // namespace knav
