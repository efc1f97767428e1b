#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/depth_profile.h"
#include "core/pose2.h"
#include "core/range_scan.h"

namespace knav {

struct FrontEndConfig;  // depth_profile_nodelet/front_end.h

/// Which topics of a recording hold what. Names with or without a leading slash.
struct ObservationReaderConfig {
  std::string source = "auto";
  std::string profile_topic = "depth_profile";
  std::string scan_topic = "scan";
  std::string depth_topic = "camera/depth/image_raw";
  std::string camera_info_topic = "camera/depth/camera_info";
  std::string odometry_topic = "odom";
  std::string mark_topic = "mark_place";
  std::string joy_topic = "joy";
  std::string base_frame = "base_link";
  int mark_button = 0;
  double reorder_s = 0.5;
  double odometry_ahead_s = 0.1;

  template <class Visitor>
  void visit(Visitor& v) {
    v.choice("source", source, {"auto", "profile", "scan", "depth"},
             "What to read; auto takes the first of profile, depth and scan that the bag has.");
    v.text("profile_topic", profile_topic, "kinect_nav/DepthProfile.");
    v.text("scan_topic", scan_topic, "sensor_msgs/LaserScan.");
    v.text("depth_topic", depth_topic, "sensor_msgs/Image, 16UC1 mm or 32FC1 m.");
    v.text("camera_info_topic", camera_info_topic, "sensor_msgs/CameraInfo of the depth images.");
    v.text("odometry_topic", odometry_topic, "nav_msgs/Odometry.");
    v.text("mark_topic", mark_topic, "std_msgs/Empty: the robot stands at a marked place.");
    v.text("joy_topic", joy_topic, "sensor_msgs/Joy, whose button mark_button means the same.");
    v.text("base_frame", base_frame, "The robot's frame, where the odometry names none (child_frame_id).");
    v.integer("mark_button", mark_button, 0, 31, "", "Index of the joystick's button that marks a place.");
    v.number("reorder_s", reorder_s, 0.0, 10.0, "s",
             "How late a message may come and still be put in order.");
    v.number("odometry_ahead_s", odometry_ahead_s, 0.0, 1.0, "s",
             "Odometry up to this long after an observation is given before it, to interpolate.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// What a recording holds, handed over in the order of stamps. Unset functions are skipped.
struct ObservationCallbacks {
  std::function<void(double stamp_s, const Pose2& T_odom_base)> add_odometry;
  std::function<void(const DepthProfile& profile, const Pose2& T_base_camera)> profile;
  std::function<void(const RangeScan& scan, const Pose2& T_base_sensor)> scan;
  std::function<void(double stamp_s)> mark;
  std::function<void(double fraction)> progress;  ///< in [0, 1]
};

/// Reads a bag as fast as it goes, with no master: the observations of one source, odometry and button marks,
/// each kind and all kinds together in the order of their stamps, odometry a little ahead. Depth images pass
/// through the front end. The same bag gives the same calls.
class ObservationReader {
 public:
  /// UserError if the bag is unreadable, or lacks the source or odometry; names the topic.
  ObservationReader(const std::string& bag_path, const ObservationReaderConfig& config,
                    const FrontEndConfig& front_end);
  ~ObservationReader();

  /// The source taken: "profile", "scan" or "depth".
  const std::string& source() const;
  /// Reads the whole bag. UserError for a damaged chunk, a clock that jumps back, a malformed message.
  void read(const ObservationCallbacks& callbacks);

  /// Of the last read().
  struct Statistics {
    std::size_t observations = 0;   ///< handed over
    std::size_t rejected = 0;       ///< depth frames the front end refused
    std::size_t late = 0;           ///< came too late to be put in order
    std::size_t without_stamp = 0;  ///< stamp 0
    std::size_t odometry = 0;
    std::size_t marks = 0;
    double first_stamp_s = 0.0, last_stamp_s = 0.0;  ///< of observations
  };
  const Statistics& statistics() const;
  /// One sentence each, e.g. that the bag has no transform to the sensor and identity was assumed.
  const std::vector<std::string>& warnings() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace knav
