#include "kinect_calib/robot_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "kinect_calib/wall_tiles.h"

namespace knav {
namespace {

constexpr double kDegree = kPi / 180.0;
constexpr int kFloorEvery = 5, kFewestFloors = 5;

double median(std::vector<double> values) { return median_of(&values); }

/// Camera axes are x forward, y left, z up; T_base_camera = Rz(yaw) Ry(pitch) Rx(roll).
FloorMount mount_of(const Eigen::Isometry3d& T_base_optical) {
  Eigen::Matrix3d R_optical_camera;
  R_optical_camera << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Eigen::Matrix3d R = T_base_optical.linear() * R_optical_camera;
  return {T_base_optical.translation().z(), -std::asin(std::clamp(R(2, 0), -1.0, 1.0)),
          std::atan2(R(2, 1), R(2, 2))};
}

double yaw_of(const Eigen::Isometry3d& T_base_optical) {
  return std::atan2(T_base_optical.linear()(1, 2), T_base_optical.linear()(0, 2));
}

}  // namespace

class RobotCheck::List {
 public:
  void add(bool ok, const std::string& name, const std::string& found, const std::string& to_do) {
    items.push_back(
        {name, ok ? CheckItem::Status::kOk : CheckItem::Status::kProblem, found, ok ? "" : to_do});
  }
  void untested(const std::string& name, const std::string& found, const std::string& to_do) {
    items.push_back({name, CheckItem::Status::kUntested, found, to_do});
  }
  std::vector<CheckItem> items;
};

void RobotCheck::Stream::add(double stamp, double arrival) {
  if (stamp_s.empty()) first_arrival_s = arrival;
  last_arrival_s = arrival;
  if (stamp <= 0.0) ++zero_stamps;
  if (!stamp_s.empty() && stamp < stamp_s.back()) ++backward;
  stamp_s.push_back(stamp);
  age_s.push_back(arrival - stamp);
}

double RobotCheck::Stream::rate_hz() const {
  const double span_s = last_arrival_s - first_arrival_s;
  return span_s > 0.0 ? static_cast<double>(stamp_s.size() - 1) / span_s : 0.0;
}

double RobotCheck::Stream::largest_gap_s() const {
  double gap_s = 0.0;
  for (std::size_t i = 1; i < stamp_s.size(); ++i) gap_s = std::max(gap_s, stamp_s[i] - stamp_s[i - 1]);
  return gap_s;
}

void RobotCheck::add_camera_info(const PinholeModel& camera) { camera_ = camera; }

void RobotCheck::add_bad_frame(double stamp_s, double arrival_s, const std::string& fault) {
  depth_.add(stamp_s, arrival_s);
  ++bad_frames_;
  last_fault_ = fault;
}

void RobotCheck::add_frame(double stamp_s, double arrival_s, const cv::Mat& depth_m) {
  depth_.add(stamp_s, arrival_s);
  int valid = 0;
  for (int v = 0; v < depth_m.rows; ++v) {
    const float* row = depth_m.ptr<float>(v);
    valid += static_cast<int>(std::count_if(row, row + depth_m.cols, [](float z) { return z > 0.0f; }));
  }
  valid_share_.push_back(static_cast<double>(valid) / static_cast<double>(depth_m.total()));
  if (!camera_ || !camera_->valid()) return;
  if (camera_->width_px != depth_m.cols || camera_->height_px != depth_m.rows) {
    ++wrong_size_;
    return;
  }
  FloorMount floor;
  if (frames_++ % kFloorEvery == 0) {
    if (finder_.find(depth_m, *camera_, static_cast<std::uint64_t>(floor_frames_++), &floor))
      floors_.push_back(floor);
  }
  // Level by the floor as seen, so that a wrong TF does not spoil the rest; by TF until there is any.
  if (floors_.empty() && !mount_) return;
  const FloorMount& mount = floors_.empty() ? *mount_ : floors_.front();
  make_level_scan(depth_m, *camera_, mount, ReadoutTiming{}, stamp_s, &scan_);
  ScanMotion motion;
  if (scan_odometry_.add(scan_, &motion)) motions_.push_back(motion);
}

void RobotCheck::add_odometry(double stamp_s, double arrival_s, const Pose2& T_odom_base) {
  odometry_stream_.add(stamp_s, arrival_s);
  if (!is_finite(T_odom_base)) {
    ++not_finite_;
  } else if (odometry_.empty() || stamp_s > odometry_.back().stamp_s) {
    odometry_.push_back({stamp_s, T_odom_base});
  }
}

void RobotCheck::set_mount(const std::optional<Eigen::Isometry3d>& T_base_optical, const std::string& why) {
  T_base_optical_ = T_base_optical;
  mount_why_ = why;
  if (T_base_optical) mount_ = mount_of(*T_base_optical);
}

void RobotCheck::set_odometry_tf(bool found, const std::string& why) {
  odometry_tf_ = found;
  odometry_tf_why_ = why;
}

void RobotCheck::check_stream(const Stream& stream, const std::string& name, double least_hz,
                              const std::string& to_do, List* list) const {
  if (stream.stamp_s.size() < 2) {
    list->add(false, name + "/rate", fmt::format("{} messages came.", stream.stamp_s.size()), to_do);
    return;
  }
  list->add(
      stream.rate_hz() >= least_hz, name + "/rate", fmt::format("{:.1f} Hz.", stream.rate_hz()),
      fmt::format("At least {:.0f} Hz are needed: look at the computer's load and the publisher's settings.",
                  least_hz));
  const double age_s = median(stream.age_s);
  const bool good =
      stream.zero_stamps == 0 && stream.backward == 0 && age_s > -0.05 && age_s < config_.most_age_s;
  list->add(
      good, name + "/stamps",
      fmt::format("Stamps are {:.0f} ms old when they arrive; {} are 0, {} go back.", 1e3 * age_s,
                  stream.zero_stamps, stream.backward),
      "Stamp with the time of measurement, on one clock: let ntp or chrony join the computers' clocks.");
}

void RobotCheck::check_sensor(List* list) const {
  check_stream(depth_, "depth", config_.least_depth_hz,
               "Start the camera, and see whether the topic's name is right (rostopic list).", list);
  if (!depth_.stamp_s.empty())
    list->add(bad_frames_ == 0, "depth/format",
              bad_frames_ == 0 ? "Every image is a depth image."
                               : fmt::format("{} are not: {}", bad_frames_, last_fault_),
              "Publish 16UC1 in mm or 32FC1 in m, unregistered.");
  if (!valid_share_.empty()) {
    const double share = median(valid_share_);
    list->add(share >= config_.least_valid_share, "depth/valid",
              fmt::format("{:.0f} % of the pixels answer.", 100 * share),
              "Look for sunlight, a covered projector or something nearer than 0.5 m; a second Kinect may "
              "interfere.");
  }
  const bool known = camera_ && camera_->valid();
  const double view_deg = known ? 2.0 * std::atan(0.5 * camera_->width_px / camera_->fx_px) / kDegree : 0.0;
  const bool right = known && wrong_size_ == 0 && view_deg > 30.0 && view_deg < 120.0;
  list->add(right, "camera_info",
            !known ? std::string(camera_ ? "It describes no camera (size or focal length 0)." : "None came.")
            : wrong_size_ > 0 ? std::string("Its size is not the images'.")
                              : fmt::format("{} x {}, {:.0f} degrees wide.", camera_->width_px,
                                            camera_->height_px, view_deg),
            "Give the driver the file of calibrate_intrinsics for this camera and this size.");
}

void RobotCheck::check_tf(List* list) const {
  list->add(mount_.has_value(), "tf/camera",
            mount_ ? "The chain from the base to the camera is there." : mount_why_,
            "Publish it with static_transform_publisher; calibrate_extrinsics prints the arguments.");
  list->add(odometry_tf_, "tf/odometry",
            odometry_tf_ ? "odom to base is there at the images' stamps." : odometry_tf_why_,
            "Let the base driver publish odom to base_link, at the stamps of its odometry.");
  check_stream(odometry_stream_, "odometry", config_.least_odometry_hz,
               "Start the base driver, and see whether the topic's name is right (rostopic list).", list);
  if (odometry_stream_.stamp_s.size() < 2) return;
  const double gap_s = odometry_stream_.largest_gap_s();
  list->add(gap_s <= config_.most_odometry_gap_s && not_finite_ == 0, "odometry/continuity",
            fmt::format("The longest gap is {:.0f} ms; {} poses are not finite.", 1e3 * gap_s, not_finite_),
            "Find what holds the base driver up.");
}

void RobotCheck::check_floor(List* list) const {
  if (floors_.size() < kFewestFloors) {
    list->untested("mount/floor",
                   fmt::format("The floor is in view in {} of {} frames.", floors_.size(), floor_frames_),
                   "Put the robot where 1 to 4 m of bare floor lie ahead.");
    return;
  }
  std::vector<double> height, pitch, roll;
  for (const FloorMount& floor : floors_) {
    height.push_back(floor.height_m);
    pitch.push_back(floor.pitch_rad);
    roll.push_back(floor.roll_rad);
  }
  const FloorMount seen = {median(height), median(pitch), median(roll)};
  const std::string found = fmt::format("By the floor: {:.3f} m high, pitch {:.1f}, roll {:.1f} degrees",
                                        seen.height_m, seen.pitch_rad / kDegree, seen.roll_rad / kDegree);
  if (!mount_) {
    list->untested("mount/floor", found + ".", "There is no TF to compare it with.");
    return;
  }
  list->add(
      std::abs(seen.height_m - mount_->height_m) <= config_.most_height_error_m &&
          std::abs(seen.pitch_rad - mount_->pitch_rad) <= config_.most_tilt_error_rad &&
          std::abs(normalize_angle_rad(seen.roll_rad - mount_->roll_rad)) <= config_.most_tilt_error_rad,
      "mount/floor",
      fmt::format("{}; by TF: {:.3f} m, {:.1f}, {:.1f}.", found, mount_->height_m,
                  mount_->pitch_rad / kDegree, mount_->roll_rad / kDegree),
      "Run calibrate_extrinsics and correct TF, or the floor is taken for an obstacle.");
}

void RobotCheck::check_motion(List* list) const {
  if (config_.standing) return;
  const MotionComparison motion = compare_motions(motions_, odometry_);
  const std::string moved = fmt::format("Odometry turned {:.0f} degrees and drove {:.2f} m",
                                        motion.turned_rad / kDegree, motion.driven_m);
  if (!motion.turn_known || motion.turned_rad < config_.least_turn_rad) {
    list->untested(
        "odometry/turn", moved + fmt::format("; the camera's motion is known in {} frames.", motion.motions),
        "Turn in place by 60 degrees to both sides, twice, with walls in view within 5 m; if the robot did "
        "turn, odometry does not say so.");
  } else {
    const double scale = motion.turn_scale.value;
    list->add(std::abs(scale - 1.0) <= config_.most_scale_error, "odometry/turn",
              fmt::format("The camera turned {:.3f} +- {:.3f} times what odometry says.", scale,
                          motion.turn_scale.sd),
              scale < 0.0 ? "Turning left must raise the yaw: reverse its sign, or swap the wheels."
                          : "Correct the wheels' distance or diameter in the base driver.");
    const double off_s = motion.time_offset_s.value - config_.time_offset_s;
    list->add(
        std::abs(off_s) <= config_.most_offset_error_s + 2.0 * motion.time_offset_s.sd, "time_offset",
        fmt::format("A depth stamp plus {:.0f} +- {:.0f} ms is odometry's time; configured are {:.0f} ms.",
                    1e3 * motion.time_offset_s.value, 1e3 * motion.time_offset_s.sd,
                    1e3 * config_.time_offset_s),
        "Run calibrate_extrinsics and set rolling_shutter/time_offset_s.");
  }
  if (!motion.drive_known || motion.driven_m < config_.least_drive_m) {
    list->untested(
        "odometry/drive", moved + ".",
        "Drive a metre straight on between walls; if the robot did drive, odometry does not say so.");
    return;
  }
  const double yaw_by_tf = T_base_optical_ ? yaw_of(*T_base_optical_) : 0.0;
  const double off_rad = std::abs(normalize_angle_rad(motion.yaw_rad.value - yaw_by_tf));
  list->add(off_rad < kPi / 2.0 && std::abs(motion.distance_scale.value - 1.0) <= config_.most_scale_error,
            "odometry/drive",
            off_rad < kPi / 2.0
                ? fmt::format("The camera drove {:.3f} +- {:.3f} times what odometry says, the same way.",
                              motion.distance_scale.value, motion.distance_scale.sd)
                : std::string("The camera drives backwards when odometry drives forwards."),
            off_rad < kPi / 2.0
                ? "Correct the wheels' diameter in the base driver, or calibrate the sensor's depth."
                : "Driving forwards must bring the scene nearer: reverse odometry's sign, or the camera's "
                  "yaw in TF.");
  if (off_rad >= kPi / 2.0) return;
  list->add(off_rad <= config_.most_yaw_error_rad + 2.0 * motion.yaw_rad.sd, "mount/yaw",
            fmt::format("The camera looks {:.1f} +- {:.1f} degrees to the left; by TF {:.1f}.",
                        motion.yaw_rad.value / kDegree, motion.yaw_rad.sd / kDegree, yaw_by_tf / kDegree),
            "Run calibrate_extrinsics and correct TF.");
}

std::vector<CheckItem> RobotCheck::checklist() const {
  List list;
  check_sensor(&list);
  check_tf(&list);
  check_floor(&list);
  check_motion(&list);
  return list.items;
}

bool RobotCheck::passed(const std::vector<CheckItem>& items) {
  return std::all_of(items.begin(), items.end(),
                     [](const CheckItem& item) { return item.status == CheckItem::Status::kOk; });
}

}  // namespace knav
