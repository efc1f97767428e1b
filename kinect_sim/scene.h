#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "kinect_sim/people.h"
#include "kinect_sim/world.h"

namespace knav {

/// What a ray needs to know of the triangle it hit.
struct Surface {
  float nx = 0.0f, ny = 0.0f,
        nz = 0.0f;  ///< unit normal in the world; 0 for people (seen from all sides alike)
  float albedo = 0.0f;
};

/// A building and its people as triangles for Embree. One thread at a time.
class Scene {
 public:
  explicit Scene(const WorldConfig& world);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// Moves people, doors and timed pieces.
  void update(const DynamicState& state);
  RTCScene rtc() const { return top_; }
  /// The surfaces of one instance, indexed by the primitive.
  const Surface* surfaces(unsigned instance) const { return surfaces_[instance].data(); }
  /// Distance along a direction to the first thing; +Inf if there is none.
  float cast(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float range_max_m) const;

 private:
  struct Mesh {
    std::vector<Eigen::Vector3f> vertices;
    std::vector<Eigen::Vector3i> triangles;
    std::vector<Surface> surfaces;
    void add_triangle(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                      Material material);
    void add_quad(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                  const Eigen::Vector3f& d, Material material);
    void add(const Solid& solid);
  };
  static Mesh person_mesh(const PersonConfig& person);
  static void add_floor(const WorldConfig& world, Mesh* mesh);
  void add_instance(const Mesh& mesh);
  void place(std::size_t instance, const Pose2& pose);

  RTCDevice device_ = nullptr;
  RTCScene top_ = nullptr;
  std::vector<RTCScene> parts_;
  std::vector<RTCGeometry> instances_;
  std::vector<std::vector<Surface>> surfaces_;
  std::size_t first_person_ = 0, first_door_ = 0, first_timed_ = 0;
  std::vector<Pose2> door_hinge_;
  std::vector<char> timed_present_;
  DynamicState last_;
  bool committed_ = false;
};

}  // namespace knav
