#pragma once

#include <kinect_nav/DepthProfile.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/LaserScan.h>

#include <deque>
#include <string>

#include "brin_benchmark/flight_recorder.h"

namespace knav {

/// Writes the 30 s before a failure as a bag: ground_truth, odom, depth_profile, scan_360, amcl_pose, plan,
/// TF; and combined_map, what the planner took for free and occupied round the robot in the end.
class FailureBag : public FlightRecorder {
 public:
  /// @param path_stem  bags are path_stem_LEG.bag
  explicit FailureBag(std::string path_stem) : path_stem_(std::move(path_stem)) {}

  void frame(double stamp_s, const Pose2& T_world_base, const Pose2& T_odom_base,
             const NavigationStack& stack) override;
  void failure(const std::string& leg, const std::string& reason) override;

 private:
  struct Moment {
    double stamp_s = 0.0;
    Pose2 T_world_base, T_odom_base, T_map_base;
    bool located = false;
    DepthProfile profile;
    RangeScan scan;
    std::vector<Point2> plan;
    std::string doing;
  };

  std::string path_stem_;
  std::deque<Moment> moments_;
  const NavigationStack* stack_ = nullptr;  ///< of the last frame
};

}  // namespace knav
