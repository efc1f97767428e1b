// compare_sensor_model: the simulated Kinect's frames against real ones, by the same measures.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "core/random.h"
#include "ros_common/command_line.h"
#include "sensor_benchmark/device_calibration.h"
#include "sensor_benchmark/flat_piece_twins.h"
#include "sensor_benchmark/scene_runner.h"
#include "sensor_benchmark/sensor_statistics.h"

namespace knav {
namespace {

constexpr double kAgree = 0.20;
constexpr int kRoomEvery = 6;
constexpr double kLeastTiles = 200;  // fewer say nothing
constexpr int kLeastPatches = 50;
constexpr double kSlanted_deg = 30.0;
/// The room's device is another than the walls': all its frames show one step, in the middle column.
constexpr double kRoomBands = 1.5;

const char* const kHelp =
    R"(REALDATA holds kinect_walls/device_{a,b}/*-d.png (raw 11-bit disparity of flat walls) and
room_sequence/data/*.depth.png (mm). Each wall is simulated at its own distance and tilt, and so is, for the noise, each
flat piece of the room; for valid readings and levels a furnished room is seen from the same heights and tilts. Written to OUT: compare_sensor_model.json (real, simulated and their ratio for
each measure, with units in the keys) and residuals.png (above a real wall, below its simulated twin; +-3 codes).)";

struct Device {
  const char* folder;
  double dc0, dc1;
  PinholeModel camera;
};
// realdata/README: z = 1 / (dc1 d + dc0)
const Device kDevices[] = {{"device_a", 3.121614, -0.002855, {640, 480, 579.8, 586.7, 321.5, 235.0}},
                           {"device_b", 3.273542, -0.002999907, {640, 480, 572.0, 584.1, 325.6, 220.1}}};

std::vector<std::string> files_in(const std::string& folder, const std::string& ending) {
  if (!std::filesystem::is_directory(folder)) throw UserError(folder + ": no such folder.");
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string path = entry.path().string();
    if (path.size() > ending.size() && path.compare(path.size() - ending.size(), ending.size(), ending) == 0)
      files.push_back(path);
  }
  if (files.empty()) throw UserError(folder + ": holds no *" + ending);
  std::sort(files.begin(), files.end());
  return files;
}

cv::Mat read_image(const std::string& path) {
  cv::Mat image = cv::imread(path, cv::IMREAD_UNCHANGED);
  if (image.type() != CV_16UC1) throw UserError(path + ": is no 16-bit grey image.");
  return image;
}

template <class DepthOf>
cv::Mat metres(const cv::Mat& raw, const DepthOf& depth_of) {
  cv::Mat depth_m(raw.rows, raw.cols, CV_32FC1);
  for (int v = 0; v < raw.rows; ++v) {
    for (int u = 0; u < raw.cols; ++u) {
      const double z = depth_of(raw.at<std::uint16_t>(v, u));
      depth_m.at<float>(v, u) =
          z > 0.0 && z < 26.0 ? static_cast<float>(z) : std::numeric_limits<float>::quiet_NaN();
    }
  }
  return depth_m;
}

/// Distance and tilts of the plane through a wall's readings: 1 / z = (1 + tilt . (x, y)) / distance.
struct WallPlane {
  double distance_m, tilt_x, tilt_y;
};
WallPlane plane_of(const cv::Mat& depth_m, const PinholeModel& camera) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Identity() * 1e-9;
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (int v = 0; v < depth_m.rows; v += 2) {
    for (int u = 0; u < depth_m.cols; u += 2) {
      const float z = depth_m.at<float>(v, u);
      if (std::isnan(z)) continue;
      const Eigen::Vector3d terms(1.0, (u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px);
      A += terms * terms.transpose();
      b += terms / static_cast<double>(z);
    }
  }
  const Eigen::Vector3d plane = A.ldlt().solve(b);
  return {1.0 / plane[0], plane[1] / plane[0], plane[2] / plane[0]};
}

/// A room like the recording's: a table and chairs before walls, looked down upon.
const char* const kRoom =
    "name: room\nceiling_m: 2.6\nspawn: [-1.5, 0, 0]\nrooms: [{x: [-2.4, 2.2], y: [-2.2, 2.2]}]\n"
    "tables: [{at: [0.8, 0.2], size: [0.9, 1.6]}]\n"
    "chairs: [{at: [0.0, 0.6], yaw_deg: 10}, {at: [0.1, -0.5], yaw_deg: -30}, {at: [1.2, -1.4], yaw_deg: "
    "80}]\n"
    "boxes: [{at: [1.9, 1.6], size: [0.5, 0.9, 1.8]}, {at: [-0.6, 1.9], size: [0.8, 0.4, 0.9]}]\n";

class Comparison {
 public:
  Comparison(const std::string& realdata, int seed)
      : realdata_(realdata), seed_(static_cast<std::uint64_t>(seed)) {}

  void run() {
    Progress progress("compare_sensor_model");
    for (const Device& device : kDevices) compare_walls(device);
    progress.update(0.3, "walls");
    std::uint64_t frame = 0;
    const std::vector<std::string> files = files_in(realdata_ + "/room_sequence/data", ".depth.png");
    const PinholeModel camera = {640, 480, 585.0, 585.0, 320.0, 240.0};
    KinectConfig kinect = KinectConfig::preset("default");
    kinect.bands = kRoomBands;
    SimulatedSensor sensor(parse_world(kRoom, "room"), kinect, seed_, 101);
    FlatPieceTwins twins(kinect, camera, seed_, 101);
    RandomStream random(seed_, random_stream::kSensorBenchmark, 8, 0);
    cv::Mat depth_mm;
    for (std::size_t i = 0; i < files.size(); i += kRoomEvery, ++frame) {
      room_[0].add(metres(read_image(files[i]), [](int mm) { return mm == 65535 ? 0.0 : 0.001 * mm; }),
                   camera);
      twins.sense(room_[0].flat_pieces(), [&](const cv::Mat& depth_m) { room_twins_.add(depth_m, camera); });
      // Held as the recording was.
      const Eigen::Isometry3d pose =
          isometry(Pose2{random.uniform(-2.0, -0.8), random.uniform(-1.2, 1.2), random.uniform(-0.6, 0.6)}) *
          optical_frame(camera_mount({0.0, 0.0, random.uniform(1.3, 1.55)}, 0.0, random.uniform(20.0, 31.0),
                                     random.uniform(-8.0, 1.0)));
      sensor.sense(
          frame, [&](double) { return pose; }, &depth_mm);
      room_[1].add(metres(depth_mm, [](int mm) { return 0.001 * mm; }), sensor.camera());
      progress.update(0.3 + 0.7 * static_cast<double>(i) / static_cast<double>(files.size()), "room");
    }
  }

  nlohmann::json report() {
    add_noise("walls", walls_[0].noise(), walls_[1].noise());
    add("walls: step between bands, rms [codes]", walls_[0].band_step_codes(), walls_[1].band_step_codes());
    add("walls: steps between bands per frame", walls_[0].bands_per_frame(), walls_[1].bands_per_frame());
    add("walls: distinct levels per code", walls_[0].levels_per_code(), walls_[1].levels_per_code());
    // The same patches as the room's, so that the two can be compared.
    add_noise("walls, patches of 32 px", walls_by_32_[0].noise(), walls_by_32_[1].noise());
    add_noise("room, 0-30 deg", room_[0].noise(0, kSlanted_deg), room_twins_.noise(0, kSlanted_deg));
    add_noise("room, 30-80 deg", room_[0].noise(kSlanted_deg, 80), room_twins_.noise(kSlanted_deg, 80));
    add("room: distinct levels per code", room_[0].levels_per_code(), room_[1].levels_per_code());
    add_valid("walls", walls_);
    add_valid("room", room_);
    return {{"agree_within", kAgree}, {"seed", seed_}, {"measures", rows_}};
  }

  cv::Mat picture() const {
    cv::Mat both;
    cv::vconcat(residual_picture(shown_[0]), residual_picture(shown_[1]), both);
    return both;
  }

 private:
  void compare_walls(const Device& device) {
    std::uint64_t seed = seed_;
    for (const std::string& file : files_in(realdata_ + "/kinect_walls/" + device.folder, "-d.png")) {
      const cv::Mat real = metres(
          read_image(file), [&](int d) { return d >= 2047 ? 0.0 : 1.0 / (device.dc1 * d + device.dc0); });
      const WallPlane plane = plane_of(real, device.camera);
      ++seed;
      WallView view(KinectConfig::preset("default"), seed, 101 + seed % 5);
      cv::Mat simulated;
      view.sense(plane.distance_m, plane.tilt_x, plane.tilt_y, &simulated);
      walls_[0].add(real, device.camera);
      walls_[1].add(simulated, view.camera());
      walls_by_32_[0].add(real, device.camera);
      walls_by_32_[1].add(simulated, view.camera());
      shown_[0] = real;
      shown_[1] = simulated;
    }
  }

  void add(const std::string& name, double real, double simulated) {
    const double ratio = simulated / real;
    // A correlation near zero has no ratio: there the difference counts.
    const bool small = name.find("autocorrelation") != std::string::npos && std::abs(real) < 0.25;
    const bool agrees = small ? std::abs(simulated - real) <= 0.05 : std::abs(ratio - 1.0) <= kAgree;
    fmt::print("{:62} real {:8.3f}  simulated {:8.3f}  {}\n", name, real, simulated,
               small ? fmt::format("difference {:+.3f} {}", simulated - real, agrees ? "" : "DIFFERS")
                     : fmt::format("ratio {:.2f} {}", ratio, agrees ? "" : "DIFFERS"));
    rows_.push_back(
        {{"name", name}, {"real", real}, {"simulated", simulated}, {"ratio", ratio}, {"agrees", agrees}});
  }

  void add_noise(const std::string& scene, const SensorStatistics::Noise& real,
                 const SensorStatistics::Noise& simulated) {
    if (real.patches < kLeastPatches || simulated.patches < kLeastPatches) return;
    add(scene + ": residual sd [codes]", real.sd_codes, simulated.sd_codes);
    for (const bool rows : {true, false}) {
      for (std::size_t i = 0; i < SensorStatistics::kLags_px.size(); ++i) {
        add(fmt::format("{}: autocorrelation at {} px {}", scene, SensorStatistics::kLags_px[i],
                        rows ? "along rows" : "down columns"),
            rows ? real.along_rows[i] : real.down_columns[i],
            rows ? simulated.along_rows[i] : simulated.down_columns[i]);
      }
    }
  }

  void add_valid(const std::string& scene, const SensorStatistics (&both)[2]) {
    using S = SensorStatistics;
    for (int i = 0; i < S::kDepthBins; ++i) {
      for (int j = 0; j < S::kIncidenceBins; ++j) {
        const S::Valid real = both[0].valid(i, j), simulated = both[1].valid(i, j);
        if (real.tiles < kLeastTiles || simulated.tiles < kLeastTiles) continue;
        const auto d = static_cast<std::size_t>(i), a = static_cast<std::size_t>(j);
        add(fmt::format("{}: valid at {:.1f}-{:.1f} m, {:.0f}-{:.0f} deg", scene, S::kDepth_m[d],
                        S::kDepth_m[d + 1], S::kIncidence_deg[a], S::kIncidence_deg[a + 1]),
            real.fraction, simulated.fraction);
      }
    }
  }

  std::string realdata_;
  std::uint64_t seed_;
  SensorStatistics walls_[2] = {{64, true}, {64, true}}, walls_by_32_[2] = {{32, true}, {32, true}},
                   room_[2] = {{32, false}, {32, false}}, room_twins_ = {32, false};
  cv::Mat shown_[2];
  nlohmann::json rows_ = nlohmann::json::array();
};

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app("Compares the simulated Kinect (preset `default`) with real Kinect v1 frames.");
  std::string realdata, out;
  int seed = 1;
  app.add_option("REALDATA", realdata, "folder with kinect_walls and room_sequence")->required();
  app.add_option("--out", out, "folder for the figures and the picture");
  app.add_option("--seed", seed, "of the simulated noise")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.footer(knav::kHelp);
  return knav::run_command(app, argc, argv, [&] {
    knav::Comparison comparison(realdata, seed);
    comparison.run();
    const nlohmann::json report = comparison.report();
    if (out.empty()) return;
    std::filesystem::create_directories(out);
    knav::write_json(out + "/compare_sensor_model.json", report.dump(2));
    std::vector<unsigned char> bytes;
    cv::imencode(".png", comparison.picture(), bytes);
    knav::write_text_atomically(out + "/residuals.png", std::string(bytes.begin(), bytes.end()));
  });
}
