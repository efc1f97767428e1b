#include "tools/depth_image_recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "core/error.h"
#include "core/file_io.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

std::vector<double> read_numbers(const std::string& path, std::size_t count) {
  std::istringstream text(read_text_file(path));
  std::vector<double> numbers;
  double number = 0.0;
  while (text >> number) numbers.push_back(number);
  if (numbers.size() != count || !text.eof()) {
    throw UserError(fmt::format("{}: expected {} numbers, found {}.", path, count, numbers.size()));
  }
  return numbers;
}

void read_intrinsics(const std::string& path, PinholeModel* camera) {
  const std::vector<double> K = read_numbers(path, 9);
  camera->fx_px = K[0];
  camera->cx_px = K[2];
  camera->fy_px = K[4];
  camera->cy_px = K[5];
  if (!camera->valid()) throw UserError(path + ": the focal lengths must be positive.");
}

void check_rotation(const std::string& where, const Eigen::Isometry3d& T) {
  const Eigen::Matrix3d R = T.linear();
  if (!T.matrix().allFinite() || (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() > 0.05 ||
      R.determinant() < 0.0) {
    throw UserError(where + ": is not a pose (its rotation is none).");
  }
}

}  // namespace

DepthImageRecording read_seven_scenes(const std::string& folder, double rate_hz) {
  DepthImageRecording recording;
  recording.level = false;
  const fs::path root(folder);
  const fs::path data = fs::is_directory(root / "data") ? root / "data" : root;
  if (fs::exists(root / "camera-intrinsics.txt")) {
    read_intrinsics((root / "camera-intrinsics.txt").string(), &recording.camera);
  }
  std::vector<std::string> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(data)) {
    const std::string name = entry.path().filename().string();
    if (name.size() > 10 && name.compare(name.size() - 10, 10, ".depth.png") == 0)
      files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  if (files.empty())
    throw UserError(data.string() + ": has no frame-NNNNNN.depth.png; is this the layout seven_scenes?");
  for (std::size_t i = 0; i < files.size(); ++i) {
    const double stamp_s = 1000.0 + static_cast<double>(i) / rate_hz;
    const std::string pose_file = files[i].substr(0, files[i].size() - 10) + ".pose.txt";
    const std::vector<double> m = read_numbers(pose_file, 16);
    StampedCameraPose pose;
    pose.stamp_s = stamp_s;
    pose.T_world_optical.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(m.data());
    check_rotation(pose_file, pose.T_world_optical);
    recording.frames.push_back({stamp_s, files[i]});
    recording.poses.push_back(pose);
  }
  return recording;
}

DepthImageRecording read_tum(const std::string& folder) {
  DepthImageRecording recording;
  recording.mm_per_unit = 0.2;  // values are 1/5000 m
  recording.camera = {640, 480, 517.3, 516.5, 318.6, 255.3};
  const fs::path root(folder);
  if (fs::exists(root / "camera-intrinsics.txt")) {
    read_intrinsics((root / "camera-intrinsics.txt").string(), &recording.camera);
  }
  const auto each_line = [](const std::string& path, const auto& visit) {
    std::istringstream text(read_text_file(path));
    std::string line;
    for (int number = 1; std::getline(text, line); ++number) {
      if (line.empty() || line[0] == '#' || line[0] == '\r') continue;
      std::istringstream fields(line);
      visit(fields, fmt::format("{}: line {}", path, number));
    }
  };
  int missing = 0;
  each_line((root / "depth.txt").string(), [&](std::istringstream& fields, const std::string& where) {
    DepthImage frame;
    std::string file;
    if (!(fields >> frame.stamp_s >> file) || !(frame.stamp_s > 0.0))
      throw UserError(where + ": expected `stamp file`.");
    frame.file = (root / file).string();
    if (!recording.frames.empty() && frame.stamp_s <= recording.frames.back().stamp_s) {
      throw UserError(where + ": the stamps must rise.");
    }
    if (fs::exists(frame.file)) {
      recording.frames.push_back(frame);
    } else {
      ++missing;
    }
  });
  if (recording.frames.empty()) {
    throw UserError(
        fmt::format("{}: none of the {} images it lists exists.", (root / "depth.txt").string(), missing));
  }
  if (missing > 0)
    fmt::print(stderr, "import_depth_images: {} listed images are missing and left out.\n", missing);
  each_line((root / "groundtruth.txt").string(), [&](std::istringstream& fields, const std::string& where) {
    double n[8];
    for (double& number : n) {
      if (!(fields >> number)) throw UserError(where + ": expected `t tx ty tz qx qy qz qw`.");
    }
    StampedCameraPose pose;
    pose.stamp_s = n[0];
    const Eigen::Quaterniond q(n[7], n[4], n[5], n[6]);
    if (std::abs(q.norm() - 1.0) > 0.01) throw UserError(where + ": the quaternion has not length 1.");
    pose.T_world_optical.linear() = q.normalized().toRotationMatrix();
    pose.T_world_optical.translation() = Eigen::Vector3d(n[1], n[2], n[3]);
    if (recording.poses.empty() || pose.stamp_s > recording.poses.back().stamp_s)
      recording.poses.push_back(pose);
  });
  if (recording.poses.size() < 2) throw UserError((root / "groundtruth.txt").string() + ": holds no poses.");
  return recording;
}

bool pose_at(const std::vector<StampedCameraPose>& poses, double stamp_s,
             Eigen::Isometry3d* T_world_optical) {
  const auto after =
      std::lower_bound(poses.begin(), poses.end(), stamp_s,
                       [](const StampedCameraPose& pose, double s) { return pose.stamp_s < s; });
  if (after == poses.end()) return false;
  if (after->stamp_s == stamp_s) {
    *T_world_optical = after->T_world_optical;
    return true;
  }
  if (after == poses.begin()) return false;
  const auto before = after - 1;
  if (after->stamp_s - before->stamp_s > 0.1) return false;
  const double t = (stamp_s - before->stamp_s) / (after->stamp_s - before->stamp_s);
  const Eigen::Quaterniond qa(before->T_world_optical.linear()), qb(after->T_world_optical.linear());
  T_world_optical->linear() = qa.slerp(t, qb).toRotationMatrix();
  T_world_optical->translation() =
      (1.0 - t) * before->T_world_optical.translation() + t * after->T_world_optical.translation();
  return true;
}

cv::Mat read_depth(const DepthImageRecording& recording, const DepthImage& frame) {
  cv::Mat image = cv::imread(frame.file, cv::IMREAD_UNCHANGED);
  if (image.empty()) throw UserError(frame.file + ": cannot be read as an image.");
  if (image.type() != CV_16UC1) throw UserError(frame.file + ": must have one channel of 16 bits.");
  if (image.cols != recording.camera.width_px || image.rows != recording.camera.height_px) {
    throw UserError(fmt::format("{}: is {} x {}, expected {} x {}.", frame.file, image.cols, image.rows,
                                recording.camera.width_px, recording.camera.height_px));
  }
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      std::uint16_t& value = image.at<std::uint16_t>(v, u);
      const double mm = value == recording.invalid ? 0.0 : std::round(value * recording.mm_per_unit);
      value = static_cast<std::uint16_t>(mm);
    }
  }
  return image;
}

}  // namespace knav
