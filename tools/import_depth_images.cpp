// import_depth_images: a folder of depth images with camera poses as a bag that replay and the nodelets read.
#include <fmt/format.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <vector>

#include "core/camera_model.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "ros_common/command_line.h"
#include "ros_common/conversions.h"
#include "tools/level_world.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string folder, out, layout;
  double rate_hz = 30.0;
};

struct StampedPose {
  double stamp_s = 0.0;
  Eigen::Isometry3d T_world_optical = Eigen::Isometry3d::Identity();
};
struct Frame {
  double stamp_s = 0.0;
  std::string file;
};
struct Recording {
  PinholeModel camera = {640, 480, 585.0, 585.0, 320.0, 240.0};
  double mm_per_unit = 1.0;
  std::uint16_t invalid = 65535;   // besides 0
  std::vector<Frame> frames;       // by stamp
  std::vector<StampedPose> poses;  // by stamp
  bool level = true;               // world z is up and the floor lies at 0
};

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

/// Frames `data/frame-000000.depth.png` with `data/frame-000000.pose.txt` (camera to world, 4x4); no stamps.
Recording read_seven_scenes(const Options& options) {
  Recording recording;
  recording.level = false;
  const fs::path root(options.folder);
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
    const double stamp_s = 1000.0 + static_cast<double>(i) / options.rate_hz;
    const std::string pose_file = files[i].substr(0, files[i].size() - 10) + ".pose.txt";
    const std::vector<double> m = read_numbers(pose_file, 16);
    StampedPose pose;
    pose.stamp_s = stamp_s;
    pose.T_world_optical.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(m.data());
    check_rotation(pose_file, pose.T_world_optical);
    recording.frames.push_back({stamp_s, files[i]});
    recording.poses.push_back(pose);
  }
  return recording;
}

/// `depth.txt` (stamp file), `depth/`, `groundtruth.txt` (t tx ty tz qx qy qz qw, motion capture with z up).
Recording read_tum(const Options& options) {
  Recording recording;
  recording.mm_per_unit = 0.2;  // values are 1/5000 m
  recording.camera = {640, 480, 517.3, 516.5, 318.6, 255.3};
  const fs::path root(options.folder);
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
    Frame frame;
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
    StampedPose pose;
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

/// The pose at a stamp, between its neighbours; false outside or in a gap of more than 0.1 s.
bool pose_at(const std::vector<StampedPose>& poses, double stamp_s, Eigen::Isometry3d* T_world_optical) {
  const auto after = std::lower_bound(poses.begin(), poses.end(), stamp_s,
                                      [](const StampedPose& pose, double s) { return pose.stamp_s < s; });
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

/// 16UC1 mm, 0 invalid.
cv::Mat read_depth(const Recording& recording, const Frame& frame) {
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

/// Turns the world so that z is up and the floor lies at 0.
void level_poses(Recording* recording) {
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
  for (StampedPose& pose : recording->poses) pose.T_world_optical = T_level_world * pose.T_world_optical;
  fmt::print(
      stderr,
      "import_depth_images: levelled by {} points; the camera is {:.2f} m above the lowest level surface.\n",
      level.level_points, recording->poses.front().T_world_optical.translation().z());
}

geometry_msgs::Transform transform_of(const Eigen::Isometry3d& T) {
  geometry_msgs::Transform transform;
  const Eigen::Quaterniond q(T.linear());
  transform.translation.x = T.translation().x();
  transform.translation.y = T.translation().y();
  transform.translation.z = T.translation().z();
  transform.rotation.x = q.x();
  transform.rotation.y = q.y();
  transform.rotation.z = q.z();
  transform.rotation.w = q.w();
  return transform;
}

geometry_msgs::TransformStamped stamped(const char* parent, const char* child, ros::Time stamp,
                                        const geometry_msgs::Transform& transform) {
  geometry_msgs::TransformStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.transform = transform;
  return message;
}

Eigen::Isometry3d camera_from_optical() {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return T;
}

/// base_link: the camera's vertical projection on the floor, looking where the camera looks.
class BagWriter {
 public:
  explicit BagWriter(rosbag::Bag* bag) : bag_(*bag) {}

  void mount(double stamp_s) {
    tf2_msgs::TFMessage message;
    message.transforms.push_back(stamped("camera_link", "camera_depth_optical_frame", ros::Time(stamp_s),
                                         transform_of(camera_from_optical())));
    bag_.write("/tf_static", ros::Time(stamp_s), message);
  }

  void pose(double stamp_s, const Eigen::Isometry3d& T_world_optical) {
    const ros::Time stamp(stamp_s);
    const Eigen::Vector3d position = T_world_optical.translation(), forward = T_world_optical.linear().col(2);
    const Pose2 T_world_base = {position.x(), position.y(), std::atan2(forward.y(), forward.x())};
    if (!started_) {
      T_odom_world_ = T_world_base.inverse();  // odometry starts at zero
      started_ = true;
    }
    const Pose2 T_odom_base = T_odom_world_ * T_world_base;
    nav_msgs::Odometry odometry;
    odometry.header.stamp = stamp;
    odometry.child_frame_id = "base_link";
    odometry.header.frame_id = "world";
    odometry.pose.pose = pose_message(T_world_base);
    bag_.write("/ground_truth", stamp, odometry);
    odometry.header.frame_id = "odom";
    odometry.pose.pose = pose_message(T_odom_base);
    bag_.write("/odom", stamp, odometry);

    Eigen::Isometry3d T_base_world = Eigen::Isometry3d::Identity();
    T_base_world.linear() =
        Eigen::AngleAxisd(-T_world_base.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    T_base_world.translation() = T_base_world.linear() * Eigen::Vector3d(-position.x(), -position.y(), 0.0);
    tf2_msgs::TFMessage tf;
    tf.transforms.push_back(stamped("odom", "base_link", stamp, transform_message(T_odom_base)));
    tf.transforms.push_back(
        stamped("base_link", "camera_link", stamp,
                transform_of(T_base_world * T_world_optical * camera_from_optical().inverse())));
    bag_.write("/tf", stamp, tf);
  }

  void frame(double stamp_s, const PinholeModel& camera, const cv::Mat& depth_mm) {
    const ros::Time stamp(stamp_s);
    info_.header.stamp = image_.header.stamp = stamp;
    info_.header.frame_id = image_.header.frame_id = "camera_depth_optical_frame";
    info_.width = image_.width = static_cast<std::uint32_t>(camera.width_px);
    info_.height = image_.height = static_cast<std::uint32_t>(camera.height_px);
    info_.distortion_model = "plumb_bob";
    info_.D.assign(5, 0.0);
    info_.K = {camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0};
    info_.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    info_.P = {camera.fx_px, 0.0, camera.cx_px, 0.0, 0.0, camera.fy_px,
               camera.cy_px, 0.0, 0.0,          0.0, 1.0, 0.0};
    image_.encoding = "16UC1";
    image_.step = image_.width * 2;
    image_.data.resize(static_cast<std::size_t>(image_.step) * image_.height);
    depth_mm.copyTo(cv::Mat(depth_mm.rows, depth_mm.cols, CV_16UC1, image_.data.data(), image_.step));
    bag_.write("/camera/depth/camera_info", stamp, info_);
    bag_.write("/camera/depth/image_raw", stamp, image_);
  }

 private:
  rosbag::Bag& bag_;
  Pose2 T_odom_world_;
  bool started_ = false;
  sensor_msgs::CameraInfo info_;
  sensor_msgs::Image image_;
};

void import(const Options& options) {
  if (!fs::is_directory(options.folder)) throw UserError(options.folder + ": no such folder.");
  Recording recording = options.layout == "tum" ? read_tum(options) : read_seven_scenes(options);
  if (!recording.level) level_poses(&recording);
  Progress progress("import_depth_images");
  std::size_t written = 0, without_pose = 0;
  write_file_atomically(options.out, [&](const std::string& beside) {
    rosbag::Bag bag(beside, rosbag::bagmode::Write);
    BagWriter writer(&bag);
    const double margin_s = 0.2;
    const double first_s = recording.frames.front().stamp_s - margin_s,
                 last_s = recording.frames.back().stamp_s + margin_s;
    auto pose = std::find_if(recording.poses.begin(), recording.poses.end(),
                             [&](const StampedPose& p) { return p.stamp_s >= first_s; });
    if (pose == recording.poses.end()) {
      throw UserError(options.folder + ": no pose has a stamp of the images' time.");
    }
    writer.mount(pose->stamp_s);
    double written_s = -1.0;
    const auto write_poses = [&](double until_s) {
      for (; pose != recording.poses.end() && pose->stamp_s < until_s && pose->stamp_s <= last_s; ++pose) {
        writer.pose(pose->stamp_s, pose->T_world_optical);
        written_s = pose->stamp_s;
      }
    };
    for (std::size_t i = 0; i < recording.frames.size(); ++i) {
      stop_if_interrupted();
      const Frame& frame = recording.frames[i];
      write_poses(frame.stamp_s);
      Eigen::Isometry3d T_world_optical;
      if (!pose_at(recording.poses, frame.stamp_s, &T_world_optical)) {
        ++without_pose;
        continue;
      }
      if (frame.stamp_s > written_s) writer.pose(frame.stamp_s, T_world_optical);
      if (pose != recording.poses.end() && pose->stamp_s == frame.stamp_s) ++pose;
      writer.frame(frame.stamp_s, recording.camera, read_depth(recording, frame));
      ++written;
      progress.update(static_cast<double>(i + 1) / static_cast<double>(recording.frames.size()),
                      fmt::format("{} frames", written));
    }
    write_poses(last_s + 1.0);
    bag.close();
    if (written == 0)
      throw UserError(options.folder + ": no image has a pose of its time (within 0.1 s on both sides).");
  });
  fmt::print("{}: {} frames, {:.1f} s{}\n", options.out, written,
             recording.frames.back().stamp_s - recording.frames.front().stamp_s,
             without_pose > 0 ? fmt::format("; {} left out for want of a pose", without_pose) : "");
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Turns a folder of depth images with camera poses into a bag: camera/depth/image_raw (16UC1 mm), "
      "camera_info,\n"
      "ground_truth and odom (the poses reduced to the plane: base_link is the camera's vertical projection "
      "on the floor),\n"
      "tf (odom -> base_link -> camera_link with the camera's own height and tilt at every pose) and "
      "tf_static.\n"
      "odom carries no error: it is the true motion.");
  knav::Options options;
  app.add_option("DIR", options.folder, "the folder")->required();
  app.add_option("OUT", options.out, "bag to write")->required();
  app.add_option("--layout", options.layout,
                 "tum: depth.txt, depth/, groundtruth.txt (z up, floor at 0; 1/5000 m). seven_scenes: "
                 "data/frame-*.depth.png "
                 "(mm) with .pose.txt, camera-intrinsics.txt; the vertical is found from floor and tables")
      ->required()
      ->check(CLI::IsMember({"tum", "seven_scenes"}));
  app.add_option("--rate", options.rate_hz, "seven_scenes: frames a second [Hz]")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  return knav::run_command(app, argc, argv, [&] { knav::import(options); });
}
