#include "kinect_sim/depth_renderer.h"

#include <cmath>
#include <limits>

namespace knav {

DepthRenderer::DepthRenderer(const PinholeModel& camera) : camera_(camera) {
  x_.resize(static_cast<std::size_t>(camera.width_px + 8), 0.0f);
  for (int u = 0; u < camera.width_px; ++u) {
    x_[static_cast<std::size_t>(u)] = static_cast<float>((u - camera.cx_px) / camera.fx_px);
  }
}

void DepthRenderer::cast_row(const Scene& scene, const Eigen::Isometry3f& T_world_optical, int row,
                             float* z_m, float* signal) const {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const auto y = static_cast<float>((row - camera_.cy_px) / camera_.fy_px);
  const Eigen::Vector3f origin = T_world_optical.translation();
  // Unnormalised, with 1 along the optical axis, so that Embree's t is the depth.
  const Eigen::Vector3f base = T_world_optical.linear() * Eigen::Vector3f(0.0f, y, 1.0f);
  const Eigen::Vector3f side = T_world_optical.linear().col(0);
  alignas(32) static const int kAll[8] = {-1, -1, -1, -1, -1, -1, -1, -1};
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  RTCRayHit8 packet;
  for (int start = 0; start < camera_.width_px; start += 8) {
    const float* x = &x_[static_cast<std::size_t>(start)];
    for (int k = 0; k < 8; ++k) {
      packet.ray.org_x[k] = origin.x();
      packet.ray.org_y[k] = origin.y();
      packet.ray.org_z[k] = origin.z();
      packet.ray.tnear[k] = 0.0f;
      packet.ray.dir_x[k] = base.x() + x[k] * side.x();
      packet.ray.dir_y[k] = base.y() + x[k] * side.y();
      packet.ray.dir_z[k] = base.z() + x[k] * side.z();
      packet.ray.time[k] = 0.0f;
      packet.ray.tfar[k] = kInfinity;
      packet.ray.mask[k] = 0xFFFFFFFFu;
      packet.ray.id[k] = 0;
      packet.ray.flags[k] = 0;
      packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect8(kAll, scene.rtc(), &context, &packet);
    for (int k = 0; k < 8; ++k) z_m[start + k] = packet.ray.tfar[k];
    if (!signal) continue;
    unsigned last_instance = RTC_INVALID_GEOMETRY_ID, last_primitive = RTC_INVALID_GEOMETRY_ID;
    Surface surface;
    for (int k = 0; k < 8; ++k) {
      if (packet.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) {
        signal[start + k] = 0.0f;
        continue;
      }
      if (packet.hit.instID[0][k] != last_instance || packet.hit.primID[k] != last_primitive) {
        last_instance = packet.hit.instID[0][k];
        last_primitive = packet.hit.primID[k];
        surface = scene.surfaces(last_instance)[last_primitive];
      }
      const float dx = packet.ray.dir_x[k], dy = packet.ray.dir_y[k], dz = packet.ray.dir_z[k];
      const float along = surface.nx * dx + surface.ny * dy + surface.nz * dz;
      const bool oriented = surface.nx != 0.0f || surface.ny != 0.0f || surface.nz != 0.0f;
      const float cosine = oriented ? std::abs(along) / std::sqrt(dx * dx + dy * dy + dz * dz) : 0.7f;
      signal[start + k] = surface.albedo * cosine;
    }
  }
}

}  // namespace knav
