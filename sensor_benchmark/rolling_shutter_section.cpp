#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/quantile.h"
#include "core/random.h"
#include "sensor_benchmark/scene_runner.h"
#include "sensor_benchmark/simulated_sensor.h"

namespace knav {
namespace {

constexpr double kSpeed_radps = 1.0;

constexpr int kSearch_px = 22;
constexpr double kPillarThickness_m = 0.02;

struct Pillar {
  double bearing_rad, range_m, half_width_m;
};

/// Upright boards all round the robot, so far apart that none lies in another's shadow, before a wall.
std::vector<Pillar> make_pillars(std::uint64_t seed) {
  RandomStream random(seed, random_stream::kSensorBenchmark, 1, 0);
  std::vector<Pillar> pillars;
  for (int i = 0; i < 36; ++i) {
    const double range_m = random.uniform(1.2, 3.0);
    pillars.push_back({(10.0 * i + random.uniform(-0.5, 0.5)) * kPi / 180.0, range_m,
                       range_m * std::tan(random.uniform(1.0, 1.5) * kPi / 180.0)});
  }
  return pillars;
}

WorldConfig pillar_world(const std::vector<Pillar>& pillars) {
  std::string text =
      "name: pillars\nceiling_m: 0\nwall_height_m: 6\nrooms: [{x: [-6, 6], y: [-6, 6]}]\nboxes:\n";
  for (const Pillar& p : pillars) {
    text += fmt::format("  - {{at: [{:.6f}, {:.6f}], yaw_deg: {:.6f}, size: [{:.6f}, {:.6f}, 4.0]}}\n",
                        p.range_m * std::cos(p.bearing_rad), p.range_m * std::sin(p.bearing_rad),
                        p.bearing_rad * 180.0 / kPi, kPillarThickness_m, 2 * p.half_width_m);
  }
  return parse_world(text, "pillars");
}

struct Edge {
  double column_px, z_m;
  bool left;  ///< the pillar begins here, else it ends
};

/// Where the pillars' edges are for a camera that stands at T_world_optical.
std::vector<Edge> true_edges(const std::vector<Pillar>& pillars, const PinholeModel& camera,
                             const Eigen::Isometry3d& T_world_optical) {
  std::vector<Edge> edges;
  for (const Pillar& p : pillars) {
    double low = 1e9, high = -1e9, z_low = 0.0, z_high = 0.0;
    bool ahead = true;
    for (const double along : {-kPillarThickness_m / 2, kPillarThickness_m / 2}) {
      for (const double across : {-p.half_width_m, p.half_width_m}) {
        const double c = std::cos(p.bearing_rad), s = std::sin(p.bearing_rad);
        const Eigen::Vector3d corner((p.range_m + along) * c - across * s,
                                     (p.range_m + along) * s + across * c, kCameraHeight_m);
        const Eigen::Vector3d seen = T_world_optical.inverse() * corner;
        if (seen.z() < 0.5) {
          ahead = false;
          continue;
        }
        const double column = camera.cx_px + camera.fx_px * seen.x() / seen.z();
        if (column < low) {
          low = column;
          z_low = seen.z();
        }
        if (column > high) {
          high = column;
          z_high = seen.z();
        }
      }
    }
    if (!ahead || low < 2 * kSearch_px || high > camera.width_px - 2 * kSearch_px) continue;
    edges.push_back({low, z_low, true});
    edges.push_back({high, z_high, false});
  }
  return edges;
}

/// Signed errors [px] of the edges' columns, row by row: an edge lies between two pixels.
void score(const cv::Mat& depth_m, const PinholeModel& camera, const std::vector<Edge>& edges,
           std::vector<double>* errors, long* missed) {
  for (const Edge& edge : edges) {
    // Seen obliquely a board's two edges differ in depth, and turning changes it.
    const double tolerance = 0.06 * edge.z_m + 0.04;
    // Towards its foot the floor is as far as the board.
    const int last_row = static_cast<int>(camera.cy_px + 0.8 * camera.fy_px * kCameraHeight_m / edge.z_m);
    for (int v = 0; v < std::min(last_row, depth_m.rows); ++v) {
      const float* row = depth_m.ptr<float>(v);
      const auto on_pillar = [&](int u) { return std::abs(row[u] - edge.z_m) <= tolerance; };
      double best = std::numeric_limits<double>::infinity();
      const int centre = static_cast<int>(std::lround(edge.column_px));
      for (int u = centre - kSearch_px; u <= centre + kSearch_px; ++u) {
        const bool step = edge.left ? on_pillar(u) && !on_pillar(u - 1) : on_pillar(u - 1) && !on_pillar(u);
        const double error = u - 0.5 - edge.column_px;
        if (step && std::abs(error) < std::abs(best)) best = error;
      }
      if (std::isfinite(best)) {
        errors->push_back(best);
      } else {
        ++*missed;
      }
    }
  }
}

nlohmann::json summary(const std::vector<double>& errors, long missed) {
  double sum = 0.0;
  std::vector<double> sizes;
  for (const double error : errors) {
    sum += error * error;
    sizes.push_back(std::abs(error));
  }
  return {{"rms_px", std::sqrt(sum / static_cast<double>(errors.size()))},
          {"p99_px", quantile(sizes, 0.99)},
          {"edge_rows", errors.size()},
          {"edge_rows_not_found", missed}};
}

}  // namespace

nlohmann::json measure_rolling_shutter(const SensorBenchmarkOptions& options, Devices* devices,
                                       std::vector<Check>* checks) {
  const std::vector<std::string> methods = {"default", "paper", "off"};
  std::vector<std::vector<double>> errors(methods.size());
  std::vector<long> missed(methods.size(), 0);
  const int frames = options.quick ? 3 : 12;
  for (int device = 0; device < devices->count(); ++device) {
    const std::vector<Pillar> pillars = make_pillars(devices->seed(device));
    SimulatedSensor sensor(pillar_world(pillars), KinectConfig::preset("default"), devices->seed(device),
                           devices->device_seed(device));
    DepthCorrector corrector(default_front_end(options).depth_correction,
                             devices->calibration("default", device));
    const Eigen::Isometry3d T_base_optical =
        optical_frame(camera_mount({kCameraForward_m, 0.0, kCameraHeight_m}, 0.0, 0.0, 0.0));
    RandomStream random(devices->seed(device), random_stream::kSensorBenchmark, 2, 0);
    cv::Mat depth_mm, rectified, unrolled;
    for (int frame = 0; frame < 2 * frames; ++frame) {
      const double speed = frame % 2 == 0 ? kSpeed_radps : -kSpeed_radps;
      const double start_rad = random.uniform(-kPi, kPi), stamp_s = 100.0 + frame;
      const auto base = [&](double after_s) { return Pose2{0.0, 0.0, start_rad + speed * after_s}; };
      const auto optical = [&](double after_s) { return isometry(base(after_s)) * T_base_optical; };
      PoseBuffer odometry;
      for (int i = -10; i <= 10; ++i) odometry.add(stamp_s + 0.02 * i, base(0.02 * i));
      sensor.sense(static_cast<std::uint64_t>(frame), optical, &depth_mm);
      corrector.correct(depth_mm, sensor.camera(), &rectified);
      const std::vector<Edge> edges = true_edges(pillars, sensor.camera(), optical(0.0));
      for (std::size_t m = 0; m < methods.size(); ++m) {
        RollingShutterConfig config = default_front_end(options).rolling_shutter;
        config.method = methods[m];
        RollingShutterCorrector rolling(config);
        const bool done = rolling.correct(rectified, sensor.camera(), stamp_s, odometry, &unrolled) ==
                          RollingShutterCorrector::Outcome::kCorrected;
        score(done ? unrolled : rectified, sensor.camera(), edges, &errors[m], &missed[m]);
      }
      options.progress((device + 0.5 * frame / frames) / devices->count(), "rolling shutter");
    }
  }
  nlohmann::json result = {{"speed_radps", kSpeed_radps}, {"frames", 2 * frames * devices->count()}};
  for (std::size_t m = 0; m < methods.size(); ++m) result[methods[m]] = summary(errors[m], missed[m]);
  checks->push_back({"rolling shutter: edges, rms [px]", result["default"]["rms_px"].get<double>(), 0.4});
  checks->push_back({"rolling shutter: edges, p99 [px]", result["default"]["p99_px"].get<double>(), 1.0});
  return result;
}

}  // namespace knav
