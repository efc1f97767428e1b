#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/trajectory.h"
#include "kinect_calib/floor_finder.h"
#include "kinect_calib/level_scan.h"
#include "kinect_calib/motion_comparison.h"

namespace knav {

struct RobotCheckConfig {
  bool standing = false;       ///< the robot is not to be moved: what needs motion is left out
  double time_offset_s = 0.0;  ///< rolling_shutter/time_offset_s as configured
  double least_depth_hz = 15.0, least_odometry_hz = 15.0;
  double most_odometry_gap_s = 0.25;  ///< rolling_shutter/odometry_gap_s
  double most_age_s = 0.5;            ///< from a stamp to its arrival
  double least_valid_share = 0.3;
  double most_height_error_m = 0.04,
         most_tilt_error_rad = 0.04;  ///< floor_removal takes 0.05 m and 3 degrees
  double most_yaw_error_rad = 0.09;
  double most_scale_error = 0.15;
  double most_offset_error_s = 0.02;
  double least_turn_rad = 1.0, least_drive_m = 0.5;
};

/// One line of the checklist.
struct CheckItem {
  enum class Status { kOk, kProblem, kUntested };
  std::string name;  ///< such as "depth/rate"
  Status status = Status::kOk;
  std::string found;  ///< one sentence
  std::string to_do;  ///< one sentence; empty if ok
};

/// Sensor, TF and odometry before the first drive. Collects what arrives, live or from a recording, and
/// judges it at the end. Motion is that of the depth images, compared with odometry's (compare_motions()), so
/// that a wrong sign shows: driving forward must bring the scene nearer, turning left must raise the yaw.
class RobotCheck {
 public:
  explicit RobotCheck(const RobotCheckConfig& config) : config_(config), finder_(FloorFinderConfig{}) {}

  /// @param camera K and P may not be valid: that is judged too
  void add_camera_info(const PinholeModel& camera);
  /// A depth message that is no good, and why.
  void add_bad_frame(double stamp_s, double arrival_s, const std::string& fault);
  /// @param depth_m 32FC1 m, NaN invalid
  void add_frame(double stamp_s, double arrival_s, const cv::Mat& depth_m);
  void add_odometry(double stamp_s, double arrival_s, const Pose2& T_odom_base);
  /// TF from the base to the camera's optical frame; why there is none otherwise.
  void set_mount(const std::optional<Eigen::Isometry3d>& T_base_optical, const std::string& why);
  bool has_mount() const { return mount_.has_value(); }
  /// TF from odom to the base.
  void set_odometry_tf(bool found, const std::string& why);

  std::vector<CheckItem> checklist() const;
  static bool passed(const std::vector<CheckItem>& items);

 private:
  struct Stream {
    std::vector<double> stamp_s, age_s;
    double first_arrival_s = 0.0, last_arrival_s = 0.0;
    int zero_stamps = 0, backward = 0;
    void add(double stamp, double arrival);
    double rate_hz() const;
    double largest_gap_s() const;
  };
  class List;
  void check_stream(const Stream& stream, const std::string& name, double least_hz, const std::string& to_do,
                    List* list) const;
  void check_sensor(List* list) const;
  void check_tf(List* list) const;
  void check_floor(List* list) const;
  void check_motion(List* list) const;

  RobotCheckConfig config_;
  Stream depth_, odometry_stream_;
  Trajectory odometry_;
  std::vector<double> valid_share_;
  int bad_frames_ = 0, wrong_size_ = 0, not_finite_ = 0;
  std::string last_fault_;
  std::optional<PinholeModel> camera_;
  std::optional<Eigen::Isometry3d> T_base_optical_;
  std::optional<FloorMount> mount_;
  std::string mount_why_ = "no transform was looked up", odometry_tf_why_ = "no transform was looked up";
  bool odometry_tf_ = false;
  FloorFinder finder_;
  std::vector<FloorMount> floors_;
  int frames_ = 0, floor_frames_ = 0;
  ScanOdometry scan_odometry_;
  LevelScan scan_;
  std::vector<ScanMotion> motions_;
};

}  // namespace knav
