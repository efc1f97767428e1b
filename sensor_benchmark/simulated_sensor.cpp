#include "sensor_benchmark/simulated_sensor.h"

#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr double kLowestObstacle_m = 0.01;

/// Calls visit(column of the levelled camera, distance along its forward axis [m], height above the floor
/// [m]) for every reading; what is not a number or not positive is none.
template <class Visit>
void for_each_reading(const cv::Mat& depth_m, const PinholeModel& camera,
                      const Eigen::Isometry3d& T_base_optical, const Visit& visit) {
  const Eigen::Vector3d origin = T_base_optical.translation();
  Eigen::Vector3d forward = T_base_optical.linear().col(2);
  forward.z() = 0.0;
  forward.normalize();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ());
  for (int v = 0; v < camera.height_px; ++v) {
    const float* row = depth_m.ptr<float>(v);
    const double y = (v - camera.cy_px) / camera.fy_px;
    for (int u = 0; u < camera.width_px; ++u) {
      if (!(row[u] > 0.0f)) continue;
      const Eigen::Vector3d ray((u - camera.cx_px) / camera.fx_px, y, 1.0);
      const Eigen::Vector3d point = T_base_optical.linear() * ray * static_cast<double>(row[u]);
      const double along = forward.dot(point);
      if (along <= 0.0) continue;
      const long column = std::lround(camera.cx_px + camera.fx_px * right.dot(point) / along);
      if (column < 0 || column >= camera.width_px) continue;
      visit(static_cast<std::size_t>(column), along, point.z() + origin.z());
    }
  }
}

}  // namespace

SimulatedSensor::SimulatedSensor(const WorldConfig& world, const KinectConfig& kinect, std::uint64_t seed,
                                 std::uint64_t device_seed)
    : camera_(kinect_camera()),
      meshes_(world),
      renderer_(meshes_, camera_),
      kinect_(kinect, camera_, seed, device_seed),
      z_m_(static_cast<std::size_t>(camera_.width_px)),
      signal_(z_m_.size()) {
  for (const PersonConfig& person : world.people) {
    PersonState state;
    state.T_world_person = {person.path[0].at.x_m, person.path[0].at.y_m, 0.0};
    state_.people.push_back(state);
  }
  for (const DoorConfig& door : world.doors) state_.door_open_rad.push_back(door_open_at(door, 0.0));
  state_.timed_solid_present.assign(world.timed_solids.size(), 0);
}

void SimulatedSensor::sense(std::uint64_t frame, const PoseAfterStamp& T_world_optical, cv::Mat* depth_mm) {
  depth_mm->create(camera_.height_px, camera_.width_px, CV_16UC1);
  const int last = camera_.height_px - 1;
  const auto pose = [&](int row) {
    return Eigen::Isometry3f(
        T_world_optical((static_cast<double>(row) / last - 0.5) * kReadout_s).cast<float>());
  };
  renderer_.start_frame(state_, pose(0), pose(last));
  kinect_.start_frame(frame);
  for (int v = 0; v <= last; ++v) {
    renderer_.render_row(pose(v), v, z_m_.data(), signal_.data());
    kinect_.sense_row(v, {z_m_.data(), signal_.data()}, depth_mm->ptr<std::uint16_t>(v));
  }
}

void SimulatedSensor::true_depth(const Eigen::Isometry3d& T_world_optical, cv::Mat* depth_m) {
  depth_m->create(camera_.height_px, camera_.width_px, CV_32FC1);
  const Eigen::Isometry3f pose(T_world_optical.cast<float>());
  renderer_.start_frame(state_, pose, pose);
  for (int v = 0; v < camera_.height_px; ++v) {
    float* row = depth_m->ptr<float>(v);
    renderer_.render_row(pose, v, row, nullptr);
    for (int u = 0; u < camera_.width_px; ++u) {
      if (!std::isfinite(row[u])) row[u] = std::numeric_limits<float>::quiet_NaN();
    }
  }
}

void true_profile(const cv::Mat& true_depth_m, const PinholeModel& camera,
                  const Eigen::Isometry3d& T_base_optical, double slice_top_m, std::vector<float>* z_m) {
  z_m->assign(static_cast<std::size_t>(camera.width_px), std::numeric_limits<float>::quiet_NaN());
  for_each_reading(true_depth_m, camera, T_base_optical,
                   [&](std::size_t column, double along_m, double height_m) {
                     if (height_m < kLowestObstacle_m || height_m > slice_top_m) return;
                     float& nearest_m = (*z_m)[column];
                     if (!(nearest_m <= along_m)) nearest_m = static_cast<float>(along_m);
                   });
}

void readings_between(const cv::Mat& depth_m, const PinholeModel& camera,
                      const Eigen::Isometry3d& T_base_optical, double bottom_m, double top_m,
                      std::vector<int>* readings) {
  readings->assign(static_cast<std::size_t>(camera.width_px), 0);
  for_each_reading(depth_m, camera, T_base_optical, [&](std::size_t column, double, double height_m) {
    if (height_m > bottom_m && height_m < top_m) ++(*readings)[column];
  });
}

}  // namespace knav
