#include "sensor_benchmark/obstacle_scenes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sensor_benchmark/scene_runner.h"

namespace knav {
namespace {

const char* const kNames[] = {"default", "paper"};
constexpr int kBoth[] = {SceneRunner::kOurs, SceneRunner::kPaper};
constexpr double kSway_deg = 2.0;

/// Something ahead, its front at x = 0, seen from `far_m` down to `near_m` (of the camera from it).
struct Scene {
  std::string name, world;
  double far_m, near_m;
};

const char* const kHall =
    "name: scene\nceiling_m: 3\nwall_height_m: 3\nrooms: [{x: [-14, 8], y: [-5, 5]}]\nspawn: [-6, 0, 0]\n";

/// The robot on its way to the scene: stands at each distance in turn, a little aside and askew, as it sways.
class Approach {
 public:
  Approach(const Scene& scene, int frames, std::uint64_t seed)
      : scene_(scene),
        frames_(frames),
        random_(seed, random_stream::kSensorBenchmark, 5, 0),
        sway_(kSway_deg, &random_),
        aside_m_(random_.uniform(-0.05, 0.05)),
        askew_rad_(random_.uniform(-3.0, 3.0) * kPi / 180.0) {}
  double duration_s() const { return frames_ / 15.0; }
  double distance_m(double t_s) const {
    const double part = std::clamp(t_s / duration_s(), 0.0, 1.0);
    return scene_.far_m + part * (scene_.near_m - scene_.far_m);
  }
  Way way() const {
    return [this](double t_s) {
      return Pose2{-distance_m(t_s) - kCameraForward_m, aside_m_,
                   askew_rad_ * distance_m(t_s) / scene_.far_m};
    };
  }
  const Sway& sway() const { return sway_; }

 private:
  Scene scene_;
  int frames_;
  RandomStream random_;
  Sway sway_;
  double aside_m_, askew_rad_;
};

template <class Judge>
void run(const Scene& scene, const SensorBenchmarkOptions& options, Devices* devices, const Judge& judge) {
  const WorldConfig world = parse_world(scene.world, scene.name);
  const int frames = options.quick ? 10 : 60;
  for (int device = 0; device < devices->count(); ++device) {
    SceneRunner runner(world, "default", device, options, devices);
    const Approach approach(scene, frames, devices->seed(device));
    for (int i = 0; i < frames; ++i) {
      const double t_s = approach.duration_s() * i / (frames - 1);
      judge(runner, runner.look(approach.way(), approach.sway(), t_s), approach.distance_m(t_s));
    }
  }
}

// --- Walls are not floor -----------------------------------------------------------------------------------

struct Taken {
  double columns = 0.0, missed = 0.0, free_beyond = 0.0;
};

constexpr double kClearOfFloor_m = 0.1;  ///< readings above this are no floor's, whatever the noise

/// Columns in which a thing near the robot is not in the profile although the sensor saw it (in the shadow
/// that a near person throws on one behind it sees nothing), or in which the profile says free beyond it
/// (seen or not).
nlohmann::json measure_taken_for_floor(const Scene& scene, const SensorBenchmarkOptions& options,
                                       Devices* devices, double* worst_percent, double* worst_free_percent) {
  const FrontEndConfig front_end = default_front_end(options);
  Taken taken[2];
  double unseen = 0.0;
  cv::Mat sensed_m;
  std::vector<int> readings;
  run(scene, options, devices, [&](SceneRunner& runner, const SceneRunner::View& view, double) {
    runner.depth_mm().convertTo(sensed_m, CV_32FC1, 0.001);
    readings_between(sensed_m, runner.camera(), view.T_base_optical, kClearOfFloor_m,
                     front_end.floor_removal.slice_top_m, &readings);
    for (std::size_t u = 4; u + 4 < view.true_z_m.size(); ++u) {
      const float farthest = largest_near(view.true_z_m, u, 4);
      // Nearer than 0.5 m the sensor is blind; beyond 3.2 m it is not this scene's.
      if (!(least_near(view.true_z_m, u, 4) > 0.52f) || !(farthest < 3.2f)) continue;
      const bool seen = readings[u] >= front_end.depth_profile.support_rows;
      unseen += seen ? 0.0 : 1.0;
      for (const int which : kBoth) {
        const DepthProfile& profile = view.profile[which];
        taken[which].columns += 1.0;
        // Unrolling and levelling may put an edge a column aside.
        const float limit_m = 1.1f * farthest + 0.1f;
        const bool there = least_near(profile.z_m, u, 1) <= limit_m;
        taken[which].missed += seen && !there ? 1.0 : 0.0;
        taken[which].free_beyond += profile.free_to_m[u] > limit_m ? 1.0 : 0.0;
      }
    }
  });
  nlohmann::json json = {{"without_reading_percent_of_columns", 100 * unseen / taken[0].columns}};
  for (const int which : kBoth) {
    json[kNames[which]] = {
        {"columns", taken[which].columns},
        {"taken_for_floor_percent_of_columns", 100 * taken[which].missed / taken[which].columns},
        {"free_beyond_it_percent_of_columns", 100 * taken[which].free_beyond / taken[which].columns}};
  }
  *worst_percent = std::max(*worst_percent, 100 * taken[0].missed / taken[0].columns);
  *worst_free_percent = std::max(*worst_free_percent, 100 * taken[0].free_beyond / taken[0].columns);
  return json;
}

// --- Things that must be in the profile --------------------------------------------------------------------

constexpr double kHalfWidth_m = 0.2;  ///< of the part looked at: the middle of each thing

/// Columns that look at the thing's middle, where the truth has its front as the nearest and at least three
/// rows show it.
std::vector<std::size_t> columns_on_it(const SceneRunner& runner, const SceneRunner::View& view,
                                       double distance_m, double slice_top_m) {
  const PinholeModel& camera = runner.camera();
  std::vector<int> rows(view.true_z_m.size(), 0);
  const Eigen::Isometry3d T_world_optical = isometry(view.T_world_base) * view.T_base_optical;
  for (int v = 0; v < camera.height_px; ++v) {
    for (int u = 0; u < camera.width_px; ++u) {
      const double z = view.true_depth_m.at<float>(v, u);
      const Eigen::Vector3d point =
          T_world_optical *
          (z * Eigen::Vector3d((u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px, 1.0));
      const bool on = std::abs(point.x()) < 0.15 && std::abs(point.y()) < kHalfWidth_m && point.z() > 0.01 &&
                      point.z() < slice_top_m;
      if (on) ++rows[static_cast<std::size_t>(u)];
    }
  }
  std::vector<std::size_t> columns;
  for (std::size_t u = 0; u < rows.size(); ++u) {
    if (rows[u] >= 3 && std::abs(view.true_z_m[u] - distance_m) < 0.05 * distance_m) columns.push_back(u);
  }
  return columns;
}

nlohmann::json measure_presence(const Scene& scene, const SensorBenchmarkOptions& options, Devices* devices,
                                std::vector<Check>* checks) {
  const double top_m = default_front_end(options).floor_removal.slice_top_m;
  int frames = 0, present[2] = {0, 0};
  run(scene, options, devices, [&](SceneRunner& runner, const SceneRunner::View& view, double distance_m) {
    const std::vector<std::size_t> columns = columns_on_it(runner, view, distance_m, top_m);
    if (columns.size() < 10) return;  // out of view
    ++frames;
    for (const int which : kBoth) {
      std::size_t seen = 0;
      for (const std::size_t u : columns) {
        const double error = std::abs(view.profile[which].z_m[u] - view.true_z_m[u]);
        seen += error < 0.05 * view.true_z_m[u] + 0.05 ? 1 : 0;
      }
      present[which] += seen * 10 >= columns.size() * 8 ? 1 : 0;
    }
  });
  nlohmann::json json = {{"from_m", scene.near_m}, {"to_m", scene.far_m}, {"frames_in_view", frames}};
  for (const int which : kBoth)
    json[kNames[which]] = {{"present_percent_of_frames", 100.0 * present[which] / frames}};
  checks->push_back(
      {"floor: " + scene.name + " present [% of frames]", 100.0 * present[0] / frames, 98.0, false});
  return json;
}

// --- Stairs down -------------------------------------------------------------------------------------------

constexpr double kStairs_m = 5.0;         // along the robot's way; floor goes on behind
constexpr double kEdgeTolerance_m = 0.1;  // less than a wheel's radius

nlohmann::json measure_stairs(const SensorBenchmarkOptions& options, Devices* devices,
                              std::vector<Check>* checks) {
  const Scene scene = {"stairs down",
                       "name: stairs\nceiling_m: 3\nwall_height_m: 3\nwalls: [{points: [[6, -8], [6, 8]]}]\n"
                       "boxes: [{at: [-9, 9], size: [1, 1, 1]}, {at: [-9, -9], size: [1, 1, 1]}]\n"
                       "stairs_down: [{min: [0, -7], max: [5, 7], direction: +x}]\nspawn: [-5, 0, 0]\n",
                       4.0, 1.4};
  double columns = 0.0, free[2] = {0.0, 0.0}, farthest_m[2] = {-9.0, -9.0};
  run(scene, options, devices, [&](SceneRunner& runner, const SceneRunner::View& view, double distance_m) {
    const PinholeModel& camera = runner.camera();
    const double c = std::cos(view.T_world_base.yaw_rad), s = std::sin(view.T_world_base.yaw_rad);
    for (std::size_t u = 0; u < view.true_z_m.size(); ++u) {
      const double x = (static_cast<double>(u) - camera.cx_px) / camera.fx_px;  // right / forward
      const double edge_m = distance_m / (c + x * s), floor_again_m = (distance_m + kStairs_m) / (c + x * s);
      columns += 1.0;
      for (const int which : kBoth) {
        const DepthProfile& profile = view.profile[which];
        if (!(profile.free_from_m[u] < floor_again_m - kEdgeTolerance_m)) continue;  // behind the stairwell
        const double beyond_m = profile.free_to_m[u] - edge_m;
        free[which] += beyond_m > kEdgeTolerance_m ? 1.0 : 0.0;
        farthest_m[which] = std::fmax(farthest_m[which], beyond_m);
      }
    }
  });
  nlohmann::json json = {{"columns", columns}};
  for (const int which : kBoth) {
    json[kNames[which]] = {{"free_beyond_the_edge_percent_of_columns", 100 * free[which] / columns},
                           {"farthest_free_beyond_the_edge_m", farthest_m[which]}};
  }
  checks->push_back({"floor: stairs down free [% of columns]", 100 * free[0] / columns, 0.0});
  return json;
}

}  // namespace

nlohmann::json measure_obstacle_scenes(const SensorBenchmarkOptions& options, Devices* devices,
                                       std::vector<Check>* checks) {
  const std::string hall = kHall;
  std::string crowd = "people:\n";
  for (int i = 0; i < 9; ++i) {
    for (const double x : {0.25, 0.9}) {
      const double y = 0.5 * (i - 4) + (x > 0.5 ? 0.25 : 0.0);
      crowd += "  - {path: [[" + std::to_string(x) + ", " + std::to_string(y) + "]]}\n";
    }
  }
  const std::vector<Scene> filling = {
      {"wall",
       "name: wall\nceiling_m: 3\nspawn: [-3, 0, 0]\nwalls: [{points: [[0.05, -9], [0.05, 9]], height_m: "
       "3}]\n",
       3.0, 0.53},
      {"crowd", hall + crowd, 2.5, 0.55},
      {"box filling the view", hall + "boxes: [{at: [0.5, 0], size: [1, 3, 1.2]}]\n", 3.0, 0.53}};
  const std::vector<Scene> present = {
      {"box of 5 cm", hall + "low_obstacles: [{at: [0.15, 0], size: [0.3, 0.6, 0.05]}]\n", 3.0, 1.3},
      {"table edge at 0.7 m", hall + "tables: [{at: [0.4, 0], size: [0.8, 1.4], height_m: 0.7}]\n", 4.0, 0.8},
      {"sign at 1.9 m", hall + "signs: [{from: [0.015, -0.5], to: [0.015, 0.5]}]\n", 8.0, 3.6}};
  nlohmann::json result;
  double worst_percent = 0.0, worst_free_percent = 0.0, done = 0.0;
  const auto step = [&] { options.progress(0.5 + 0.5 * (done += 1.0) / 7.0, "floor: scenes"); };
  for (const Scene& scene : filling) {
    result[scene.name] =
        measure_taken_for_floor(scene, options, devices, &worst_percent, &worst_free_percent);
    step();
  }
  checks->push_back({"floor: wall, crowd, box taken for floor [% of columns]", worst_percent, 0.0});
  checks->push_back({"floor: free beyond wall, crowd, box [% of columns]", worst_free_percent, 0.0});
  for (const Scene& scene : present) {
    result[scene.name] = measure_presence(scene, options, devices, checks);
    step();
  }
  result["stairs down"] = measure_stairs(options, devices, checks);
  return result;
}

}  // namespace knav
