#include "kinect_sim/scene.h"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace knav {

Scene::Scene(const WorldMeshes& meshes) : meshes_(&meshes) {
  device_ = rtcNewDevice("threads=1,set_affinity=0");
  if (!device_) throw std::runtime_error("Embree gives no device");
  top_ = rtcNewScene(device_);
  for (const Mesh& mesh : meshes.meshes()) add_instance(mesh);
  rtcCommitScene(top_);
}

Scene::~Scene() {
  for (RTCGeometry instance : instances_) rtcReleaseGeometry(instance);
  for (RTCScene part : parts_) rtcReleaseScene(part);
  if (top_) rtcReleaseScene(top_);
  if (device_) rtcReleaseDevice(device_);
}

void Scene::add_instance(const Mesh& mesh) {
  std::vector<unsigned> triangles;
  for (const Face& face : mesh.faces) {
    for (unsigned k = 1; k + 1 < face.count; ++k) {
      triangles.insert(triangles.end(), {face.first, face.first + k, face.first + k + 1});
    }
  }
  RTCScene part = rtcNewScene(device_);
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), mesh.vertices.size()));
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    for (int k = 0; k < 3; ++k) *vertices++ = vertex[k];
  }
  auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), triangles.size() / 3));
  std::copy(triangles.begin(), triangles.end(), indices);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(part, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(part);
  RTCGeometry instance = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(instance, part);
  rtcAttachGeometryByID(top_, instance, static_cast<unsigned>(instances_.size()));
  parts_.push_back(part);
  instances_.push_back(instance);
  pose_.emplace_back();
  present_.push_back(1);
  place(instances_.size() - 1, Pose2());
}

void Scene::place(std::size_t instance, const Pose2& pose) {
  const auto c = static_cast<float>(std::cos(pose.yaw_rad)), s = static_cast<float>(std::sin(pose.yaw_rad));
  const auto x = static_cast<float>(pose.x_m), y = static_cast<float>(pose.y_m);
  const float transform[12] = {c, s, 0, -s, c, 0, 0, 0, 1, x, y, 0};
  rtcSetGeometryTransform(instances_[instance], 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, transform);
  rtcCommitGeometry(instances_[instance]);
}

void Scene::update(const DynamicState& state) {
  bool changed = false;
  for (std::size_t i = 1; i < instances_.size(); ++i) {
    Pose2 pose;
    const char present = meshes_->pose(i, state, &pose);
    if (present != present_[i]) {
      present ? rtcEnableGeometry(instances_[i]) : rtcDisableGeometry(instances_[i]);
      present_[i] = present;
      changed = true;
    }
    if (pose.x_m != pose_[i].x_m || pose.y_m != pose_[i].y_m || pose.yaw_rad != pose_[i].yaw_rad) {
      place(i, pose);
      pose_[i] = pose;
      changed = true;
    }
  }
  if (changed) rtcCommitScene(top_);
}

float Scene::cast(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float limit) const {
  RTCRayHit hit{};
  hit.ray.org_x = origin.x();
  hit.ray.org_y = origin.y();
  hit.ray.org_z = origin.z();
  hit.ray.dir_x = direction.x();
  hit.ray.dir_y = direction.y();
  hit.ray.dir_z = direction.z();
  hit.ray.tfar = limit;
  hit.ray.mask = 0xFFFFFFFFu;
  hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(top_, &context, &hit);
  return hit.hit.geomID == RTC_INVALID_GEOMETRY_ID ? std::numeric_limits<float>::infinity() : hit.ray.tfar;
}

}  // namespace knav
