#include "kinect_sim/mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace knav {
namespace {

Eigen::Vector3f at(const Point2& p, double z_m) {
  return {static_cast<float>(p.x_m), static_cast<float>(p.y_m), static_cast<float>(z_m)};
}

void add_floor_and_ceiling(const WorldConfig& world, Mesh* mesh) {
  // The floor between the stairs: cut along the lines of all holes.
  const FloorRect& b = world.bounds;
  std::vector<double> xs = {b.min_x_m, b.max_x_m}, ys = {b.min_y_m, b.max_y_m};
  for (const FloorRect& hole : world.stairs) {
    xs.insert(xs.end(), {hole.min_x_m, hole.max_x_m});
    ys.insert(ys.end(), {hole.min_y_m, hole.max_y_m});
  }
  std::sort(xs.begin(), xs.end());
  std::sort(ys.begin(), ys.end());
  const auto quad = [&](const FloorRect& r, double z, Material material) {
    mesh->add_face({at({r.min_x_m, r.min_y_m}, z), at({r.max_x_m, r.min_y_m}, z),
                    at({r.max_x_m, r.max_y_m}, z), at({r.min_x_m, r.max_y_m}, z)},
                   material);
  };
  for (std::size_t i = 0; i + 1 < xs.size(); ++i) {
    for (std::size_t j = 0; j + 1 < ys.size(); ++j) {
      if (xs[i + 1] - xs[i] < 1e-6 || ys[j + 1] - ys[j] < 1e-6) continue;
      const double x = (xs[i] + xs[i + 1]) / 2, y = (ys[j] + ys[j + 1]) / 2;
      const bool is_hole = std::any_of(world.stairs.begin(), world.stairs.end(),
                                       [&](const FloorRect& hole) { return hole.contains(x, y); });
      if (!is_hole) quad({xs[i], ys[j], xs[i + 1], ys[j + 1]}, 0.0, Material::kFloor);
    }
  }
  for (const FloorRect& sun : world.sun_patches) quad(sun, 0.002, Material::kSun);
  if (world.ceiling_m > 0.0) {
    const double z = world.ceiling_m;
    mesh->add_face({at({b.min_x_m, b.min_y_m}, z), at({b.min_x_m, b.max_y_m}, z),
                    at({b.max_x_m, b.max_y_m}, z), at({b.max_x_m, b.min_y_m}, z)},
                   Material::kCeiling);
  }
}

Mesh person_mesh(const PersonConfig& person) {
  // Two legs, a body, a head; the body fills the radius across, less in depth.
  Mesh mesh;
  const double r = person.radius_m, h = person.height_m;
  const auto ellipse = [&](double across, double deep, double bottom, double top, double y) {
    Solid part = make_cylinder({0, 0}, 1.0, bottom, top, Material::kPerson);
    for (Point2& c : part.corners) c = {c.x_m * deep, c.y_m * across + y};
    mesh.add(part);
  };
  ellipse(0.075, 0.085, 0.0, 0.48 * h, 0.11);
  ellipse(0.075, 0.085, 0.0, 0.48 * h, -0.11);
  ellipse(r, 0.62 * r, 0.46 * h, 0.83 * h, 0.0);
  ellipse(0.08, 0.09, 0.83 * h, h, 0.0);
  return mesh;
}

}  // namespace

void Mesh::add_face(const std::vector<Eigen::Vector3f>& corners, Material material) {
  Face face;
  face.first = static_cast<std::uint32_t>(vertices.size());
  face.count = static_cast<std::uint32_t>(corners.size());
  face.normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
  face.albedo = static_cast<float>(albedo(material));
  face.diffuse_all_round = material == Material::kPerson;
  vertices.insert(vertices.end(), corners.begin(), corners.end());
  faces.push_back(face);
}

void Mesh::add(const Solid& solid) {
  const std::size_t n = solid.corners.size();
  std::vector<Eigen::Vector3f> top, bottom;
  for (std::size_t i = 0; i < n; ++i) {
    const Point2 &p = solid.corners[i], &q = solid.corners[(i + 1) % n];
    add_face({at(p, solid.bottom_m), at(q, solid.bottom_m), at(q, solid.top_m), at(p, solid.top_m)},
             solid.material);
    top.push_back(at(p, solid.top_m));
    bottom.push_back(at(solid.corners[n - 1 - i], solid.bottom_m));
  }
  add_face(top, solid.material);
  if (solid.bottom_m > 1e-6) add_face(bottom, solid.material);
}

WorldMeshes::WorldMeshes(const WorldConfig& world) {
  Mesh building;
  add_floor_and_ceiling(world, &building);
  for (const Solid& solid : world.solids) {
    if (solid.material != Material::kGlass) building.add(solid);
  }
  for (const Panel& panel : world.panels) {
    std::vector<Eigen::Vector3f> corners;
    for (const Eigen::Vector3d& corner : panel.corners) corners.push_back(corner.cast<float>());
    building.add_face(corners, panel.material);
  }
  meshes_.push_back(std::move(building));
  for (const PersonConfig& person : world.people) meshes_.push_back(person_mesh(person));
  first_door_ = meshes_.size();
  for (const DoorConfig& door : world.doors) {
    const double dx = door.closed_end.x_m - door.hinge.x_m, dy = door.closed_end.y_m - door.hinge.y_m;
    T_world_hinge_.push_back({door.hinge.x_m, door.hinge.y_m, std::atan2(dy, dx)});
    Mesh leaf;
    leaf.add(transformed(T_world_hinge_.back().inverse(), door_leaf(door, 0.0)));
    meshes_.push_back(std::move(leaf));
  }
  first_timed_ = meshes_.size();
  for (const TimedSolid& timed : world.timed_solids) {
    Mesh mesh;
    mesh.add(timed.solid);
    meshes_.push_back(std::move(mesh));
  }
}

bool WorldMeshes::pose(std::size_t i, const DynamicState& state, Pose2* T_world_piece) const {
  *T_world_piece = Pose2();
  if (i == 0) return true;
  if (i < first_door_) {
    *T_world_piece = state.people[i - 1].T_world_person;
    return true;
  }
  if (i < first_timed_) {
    const std::size_t door = i - first_door_;
    *T_world_piece = T_world_hinge_[door] * Pose2{0, 0, state.door_open_rad[door]};
    return true;
  }
  return state.timed_solid_present[i - first_timed_] != 0;
}

}  // namespace knav
