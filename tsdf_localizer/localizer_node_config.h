#pragma once

#include <Eigen/Core>
#include <cmath>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "core/pose2.h"
#include "tsdf_localizer/correction.h"
#include "tsdf_localizer/localizer_config.h"

namespace knav {

/// Parameters of the nodelet kinect_nav/Localizer: those of the filter beside those of its ROS side. Names
/// that amcl has mean what they mean there.
struct LocalizerNodeConfig {
  LocalizerConfig localizer;
  std::string global_frame_id = "map";
  std::string odom_frame_id = "odom";
  std::string base_frame_id = "base_link";
  double transform_tolerance = 0.1;
  bool tf_broadcast = true;
  double tf_rate_hz = 30.0;
  SlewLimit slew;
  std::string initial_pose_x, initial_pose_y, initial_pose_a;  ///< texts, so that they can be left open
  double initial_cov_xx = 0.25, initial_cov_yy = 0.25, initial_cov_aa = 0.0685;
  double save_pose_rate = 0.2;
  std::string saved_pose_file = "auto";
  std::string motion_source = "auto";
  std::string intensities = "auto";
  double wait_for_transform_s = 0.5;
  double scan_timeout_s = 1.0;

  template <class Visitor>
  void visit(Visitor& v) {
    localizer.visit(v);
    v.text("global_frame_id", global_frame_id, "Frame of the map (amcl).");
    v.text("odom_frame_id", odom_frame_id, "Frame of the odometry (amcl).");
    v.text("base_frame_id", base_frame_id, "Frame of the robot's base (amcl).");
    v.number("transform_tolerance", transform_tolerance, 0, 10, "s",
             "How far the published map->odom is post-dated (amcl).");
    v.flag("tf_broadcast", tf_broadcast, "Publish map->odom (amcl).");
    v.number("tf_rate_hz", tf_rate_hz, 1, 1000, "Hz", "Rate of map->odom, whatever the scans do.");
    v.number("slew_limit_mps", slew.speed_mps, 0, 100, "m/s",
             "How fast map->odom may move the robot in the map; 0: at once, as amcl.");
    v.number("slew_limit_radps", slew.turn_radps, 0, 100, "rad/s", "How fast it may turn the robot; 0: at once.");
    v.number("slew_jump_m", slew.jump_m, 0, 1000, "m", "A correction larger than this is taken at once in any case, ...");
    v.number("slew_jump_rad", slew.jump_rad, 0, 4, "rad", "... or than this.");
    v.text("initial_pose_x", initial_pose_x,
           "Pose to start from [m]; all three empty: unknown, see saved_pose_file (amcl).");
    v.text("initial_pose_y", initial_pose_y, "Pose to start from [m] (amcl).");
    v.text("initial_pose_a", initial_pose_a, "Pose to start from: heading [rad] (amcl).");
    v.number("initial_cov_xx", initial_cov_xx, 0, 1e6, "m^2",
             "Variance of that pose, and of one given without (amcl).");
    v.number("initial_cov_yy", initial_cov_yy, 0, 1e6, "m^2",
             "Variance of that pose, and of one given without (amcl).");
    v.number("initial_cov_aa", initial_cov_aa, 0, 1e6, "rad^2",
             "Variance of that pose, and of one given without (amcl).");
    v.number("save_pose_rate", save_pose_rate, 0, 100, "Hz",
             "How often a pose that is ok is saved; 0: never (amcl, which saves to the parameter server).");
    v.text("saved_pose_file", saved_pose_file,
           "Where to save it; auto: kinect_nav_pose.yaml in $ROS_HOME or ~/.ros; empty: nowhere.");
    v.choice("motion_source", motion_source, {"auto", "motion_estimate", "odom"},
             "Motion from the local mapper, or from TF's odometry; auto: from the mapper once it publishes.");
    v.choice("intensities", intensities, {"auto", "evidence", "ignore"},
             "Whether the scan's intensities are each ray's evidence; auto: if they all lie in [0, 1].");
    v.number("wait_for_transform_s", wait_for_transform_s, 0, 10, "s",
             "How long a scan waits for the motion and the transforms at its stamp.");
    v.number("scan_timeout_s", scan_timeout_s, 0.1, 1000, "s",
             "Without a scan for this long the verdict is uncertain.");
  }
  std::vector<std::string> validate() const {
    std::vector<std::string> faults = localizer.validate();
    if (global_frame_id.empty() || odom_frame_id.empty() || base_frame_id.empty()) {
      faults.push_back("global_frame_id, odom_frame_id and base_frame_id must not be empty.");
    } else if (global_frame_id == odom_frame_id || odom_frame_id == base_frame_id ||
               global_frame_id == base_frame_id) {
      faults.push_back("global_frame_id, odom_frame_id and base_frame_id must differ.");
    }
    for (const std::string* text : {&initial_pose_x, &initial_pose_y, &initial_pose_a}) {
      if (!text->empty() && !parse(*text)) {
        faults.push_back("initial_pose_x, _y and _a must be finite numbers, or empty; one is '" + *text +
                         "'.");
      }
    }
    return faults;
  }
  /// Nothing if all three are empty; one that is empty beside others is 0.
  std::optional<Pose2> initial_pose() const {
    if (initial_pose_x.empty() && initial_pose_y.empty() && initial_pose_a.empty()) return std::nullopt;
    return Pose2{parse(initial_pose_x).value_or(0.0), parse(initial_pose_y).value_or(0.0),
                 parse(initial_pose_a).value_or(0.0)};
  }
  Eigen::Matrix3d initial_covariance() const {
    return Eigen::Vector3d(initial_cov_xx, initial_cov_yy, initial_cov_aa).asDiagonal();
  }

 private:
  static std::optional<double> parse(const std::string& text) {
    try {
      std::size_t used = 0;
      const double value = std::stod(text, &used);
      if (used == text.size() && std::isfinite(value)) return value;
    } catch (const std::exception&) {
    }
    return std::nullopt;
  }
};

}  // namespace knav
