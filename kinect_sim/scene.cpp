#include "kinect_sim/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace knav {
namespace {

Eigen::Vector3f at(const Point2& p, double z_m) {
  return {static_cast<float>(p.x_m), static_cast<float>(p.y_m), static_cast<float>(z_m)};
}

}  // namespace

void Scene::Mesh::add_triangle(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                               Material material) {
  const auto first = static_cast<int>(vertices.size());
  vertices.insert(vertices.end(), {a, b, c});
  triangles.emplace_back(first, first + 1, first + 2);
  const Eigen::Vector3f normal = (b - a).cross(c - a).normalized();
  Surface surface{normal.x(), normal.y(), normal.z(), static_cast<float>(albedo(material))};
  if (material == Material::kPerson) surface.nx = surface.ny = surface.nz = 0.0f;
  surfaces.push_back(surface);
}

void Scene::Mesh::add_quad(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                           const Eigen::Vector3f& d, Material material) {
  add_triangle(a, b, c, material);
  add_triangle(a, c, d, material);
}

void Scene::Mesh::add(const Solid& solid) {
  const std::size_t n = solid.corners.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Point2 &p = solid.corners[i], &q = solid.corners[(i + 1) % n];
    add_quad(at(p, solid.bottom_m), at(q, solid.bottom_m), at(q, solid.top_m), at(p, solid.top_m),
             solid.material);
  }
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const Point2 &p = solid.corners[0], &q = solid.corners[i], &r = solid.corners[i + 1];
    add_triangle(at(p, solid.top_m), at(q, solid.top_m), at(r, solid.top_m), solid.material);
    if (std::abs(solid.bottom_m) > 1e-6) {
      add_triangle(at(p, solid.bottom_m), at(r, solid.bottom_m), at(q, solid.bottom_m), solid.material);
    }
  }
}

void Scene::add_floor(const WorldConfig& world, Mesh* mesh) {
  // The floor between the stairs: cut along the lines of all holes.
  std::vector<double> xs = {world.bounds.min_x_m, world.bounds.max_x_m};
  std::vector<double> ys = {world.bounds.min_y_m, world.bounds.max_y_m};
  for (const FloorRect& hole : world.stairs) {
    xs.insert(xs.end(), {hole.min_x_m, hole.max_x_m});
    ys.insert(ys.end(), {hole.min_y_m, hole.max_y_m});
  }
  std::sort(xs.begin(), xs.end());
  std::sort(ys.begin(), ys.end());
  const auto quad = [&](double x0, double y0, double x1, double y1, double z, Material material) {
    mesh->add_quad(at({x0, y0}, z), at({x1, y0}, z), at({x1, y1}, z), at({x0, y1}, z), material);
  };
  for (std::size_t i = 0; i + 1 < xs.size(); ++i) {
    for (std::size_t j = 0; j + 1 < ys.size(); ++j) {
      if (xs[i + 1] - xs[i] < 1e-6 || ys[j + 1] - ys[j] < 1e-6) continue;
      const double x = (xs[i] + xs[i + 1]) / 2, y = (ys[j] + ys[j + 1]) / 2;
      if (std::any_of(world.stairs.begin(), world.stairs.end(),
                      [&](const FloorRect& hole) { return hole.contains(x, y); })) {
        continue;
      }
      quad(xs[i], ys[j], xs[i + 1], ys[j + 1], 0.0, Material::kFloor);
    }
  }
  for (const FloorRect& sun : world.sun_patches) {
    quad(sun.min_x_m, sun.min_y_m, sun.max_x_m, sun.max_y_m, 0.002, Material::kSun);
  }
  if (world.ceiling_m > 0.0) {
    const FloorRect& b = world.bounds;
    quad(b.min_x_m, b.min_y_m, b.max_x_m, b.max_y_m, world.ceiling_m, Material::kCeiling);
  }
}

Scene::Mesh Scene::person_mesh(const PersonConfig& person) {
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

Scene::Scene(const WorldConfig& world) {
  device_ = rtcNewDevice("threads=1,set_affinity=0");
  if (!device_) throw std::runtime_error("Embree gives no device");
  top_ = rtcNewScene(device_);
  Mesh building;
  add_floor(world, &building);
  for (const Solid& solid : world.solids) {
    if (solid.material != Material::kGlass) building.add(solid);
  }
  add_instance(building);
  first_person_ = instances_.size();
  for (const PersonConfig& person : world.people) add_instance(person_mesh(person));
  first_door_ = instances_.size();
  for (const DoorConfig& door : world.doors) {
    // The leaf in its hinge's frame.
    const double dx = door.closed_end.x_m - door.hinge.x_m, dy = door.closed_end.y_m - door.hinge.y_m;
    door_hinge_.push_back({door.hinge.x_m, door.hinge.y_m, std::atan2(dy, dx)});
    Mesh leaf;
    leaf.add(transformed(door_hinge_.back().inverse(), door_leaf(door, 0.0)));
    for (Surface& surface : leaf.surfaces) surface.nx = surface.ny = surface.nz = 0.0f;  // it turns
    add_instance(leaf);
  }
  first_timed_ = instances_.size();
  for (const TimedSolid& timed : world.timed_solids) {
    Mesh mesh;
    mesh.add(timed.solid);
    add_instance(mesh);
  }
  timed_present_.assign(world.timed_solids.size(), 1);
  rtcCommitScene(top_);
}

Scene::~Scene() {
  for (RTCGeometry instance : instances_) rtcReleaseGeometry(instance);
  for (RTCScene part : parts_) rtcReleaseScene(part);
  if (top_) rtcReleaseScene(top_);
  if (device_) rtcReleaseDevice(device_);
}

void Scene::add_instance(const Mesh& mesh) {
  RTCScene part = rtcNewScene(device_);
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), mesh.vertices.size()));
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (int k = 0; k < 3; ++k) vertices[3 * i + static_cast<std::size_t>(k)] = mesh.vertices[i][k];
  }
  auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), mesh.triangles.size()));
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (int k = 0; k < 3; ++k)
      indices[3 * i + static_cast<std::size_t>(k)] = static_cast<unsigned>(mesh.triangles[i][k]);
  }
  rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(part, geometry);
  rtcReleaseGeometry(geometry);
  rtcSetSceneBuildQuality(part, RTC_BUILD_QUALITY_HIGH);
  rtcCommitScene(part);
  RTCGeometry instance = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(instance, part);
  rtcAttachGeometryByID(top_, instance, static_cast<unsigned>(instances_.size()));
  parts_.push_back(part);
  instances_.push_back(instance);
  surfaces_.push_back(mesh.surfaces);
  place(instances_.size() - 1, Pose2());
}

void Scene::place(std::size_t instance, const Pose2& pose) {
  const auto c = static_cast<float>(std::cos(pose.yaw_rad)), s = static_cast<float>(std::sin(pose.yaw_rad));
  const float transform[12] = {
      c, s, 0, -s, c, 0, 0, 0, 1, static_cast<float>(pose.x_m), static_cast<float>(pose.y_m), 0};
  rtcSetGeometryTransform(instances_[instance], 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, transform);
  rtcCommitGeometry(instances_[instance]);
}

void Scene::update(const DynamicState& state) {
  bool changed = !committed_;
  const auto differs = [](const Pose2& a, const Pose2& b) {
    return a.x_m != b.x_m || a.y_m != b.y_m || a.yaw_rad != b.yaw_rad;
  };
  for (std::size_t i = 0; i < state.people.size(); ++i) {
    if (committed_ && !differs(state.people[i].T_world_person, last_.people[i].T_world_person)) continue;
    place(first_person_ + i, state.people[i].T_world_person);
    changed = true;
  }
  for (std::size_t i = 0; i < state.door_open_rad.size(); ++i) {
    if (committed_ && state.door_open_rad[i] == last_.door_open_rad[i]) continue;
    place(first_door_ + i, door_hinge_[i] * Pose2{0, 0, state.door_open_rad[i]});
    changed = true;
  }
  for (std::size_t i = 0; i < state.timed_solid_present.size(); ++i) {
    if (timed_present_[i] == state.timed_solid_present[i]) continue;
    timed_present_[i] = state.timed_solid_present[i];
    if (timed_present_[i]) {
      rtcEnableGeometry(instances_[first_timed_ + i]);
    } else {
      rtcDisableGeometry(instances_[first_timed_ + i]);
    }
    changed = true;
  }
  if (!changed) return;
  rtcCommitScene(top_);
  last_ = state;
  committed_ = true;
}

float Scene::cast(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float range_max_m) const {
  RTCRayHit hit{};
  hit.ray.org_x = origin.x();
  hit.ray.org_y = origin.y();
  hit.ray.org_z = origin.z();
  hit.ray.dir_x = direction.x();
  hit.ray.dir_y = direction.y();
  hit.ray.dir_z = direction.z();
  hit.ray.tfar = range_max_m;
  hit.ray.mask = 0xFFFFFFFFu;
  hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(top_, &context, &hit);
  return hit.hit.geomID == RTC_INVALID_GEOMETRY_ID ? std::numeric_limits<float>::infinity() : hit.ray.tfar;
}

}  // namespace knav
