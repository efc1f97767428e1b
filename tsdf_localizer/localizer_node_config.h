#pragma once

#include <string>
#include <vector>

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
  double initial_pose_x = 0.0, initial_pose_y = 0.0, initial_pose_a = 0.0;
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
    v.number("initial_pose_x", initial_pose_x, -1e6, 1e6, "m",
             "Pose to start from, used if any of the three is set (amcl).");
    v.number("initial_pose_y", initial_pose_y, -1e6, 1e6, "m", "Pose to start from (amcl).");
    v.number("initial_pose_a", initial_pose_a, -1e6, 1e6, "rad", "Pose to start from: heading (amcl).");
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
    return faults;
  }
};

}  // namespace knav
