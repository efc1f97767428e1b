#include "tools/level_poses.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "core/error.h"
#include "tools/level_world.h"

namespace knav {
namespace {

/// Points of surfaces with their normals, a few hundred a frame.
void add_surface_points(const cv::Mat& depth_mm, const PinholeModel& camera,
                        const Eigen::Isometry3d& T_world_optical, std::vector<SurfacePoint>* points) {
  constexpr int kReach = 6;
  const auto point = [&](int u, int v) {
    const double z = 0.001 * depth_mm.at<std::uint16_t>(v, u);
    return Eigen::Vector3d((u - camera.cx_px) / camera.fx_px * z, (v - camera.cy_px) / camera.fy_px * z, z);
  };
  for (int v = kReach; v < depth_mm.rows - kReach; v += 16) {
    for (int u = kReach; u < depth_mm.cols - kReach; u += 16) {
      const Eigen::Vector3d p = point(u, v);
      const Eigen::Vector3d neighbours[] = {point(u - kReach, v), point(u + kReach, v), point(u, v - kReach),
                                            point(u, v + kReach)};
      bool smooth = p.z() > 0.4 && p.z() < 4.0;
      for (const Eigen::Vector3d& n : neighbours)
        smooth = smooth && n.z() > 0.0 && std::abs(n.z() - p.z()) < 0.1 * p.z();
      if (!smooth) continue;
      const Eigen::Vector3d across = neighbours[1] - neighbours[0], down = neighbours[3] - neighbours[2];
      Eigen::Vector3d normal = down.cross(across);
      if (normal.norm() < 1e-9) continue;
      normal.normalize();
      if (normal.dot(p) > 0.0) normal = -normal;
      points->push_back({T_world_optical * p, T_world_optical.linear() * normal});
    }
  }
}

}  // namespace

void level_poses(DepthImageRecording* recording) {
  std::vector<SurfacePoint> points;
  Eigen::Vector3d guess = Eigen::Vector3d::Zero();
  const std::size_t step = std::max<std::size_t>(1, recording->frames.size() / 40);
  for (std::size_t i = 0; i < recording->frames.size(); i += step) {
    Eigen::Isometry3d T;
    if (!pose_at(recording->poses, recording->frames[i].stamp_s, &T)) continue;
    add_surface_points(read_depth(*recording, recording->frames[i]), recording->camera, T, &points);
    guess -= T.linear().col(1);  // people hold cameras more or less upright
  }
  const LevelWorld level = find_level(points, guess);
  if (level.level_points < 100) {
    throw UserError(recording->frames.front().file + ": no floor or table is seen to find the vertical by.");
  }
  Eigen::Isometry3d T_level_world = Eigen::Isometry3d::Identity();
  T_level_world.linear() =
      Eigen::Quaterniond::FromTwoVectors(level.up, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T_level_world.translation().z() = -level.floor_m;
  for (StampedCameraPose& pose : recording->poses)
    pose.T_world_optical = T_level_world * pose.T_world_optical;
  fmt::print(
      stderr,
      "import_depth_images: levelled by {} points; the camera is {:.2f} m above the lowest level surface.\n",
      level.level_points, recording->poses.front().T_world_optical.translation().z());
}

}  // namespace knav
