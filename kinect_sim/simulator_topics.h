#pragma once

#include <ros/node_handle.h>

#include "kinect_sim/simulator.h"

namespace knav {

/// What a simulated robot publishes beside its sensors' data: /clock, odom, /tf, /tf_static, ground_truth, people,
/// collisions, walker_contacts, bumper. Belongs to the thread that steps the simulator.
class SimulatorTopics {
 public:
  /// @param odom_rate_hz  of odom, its TF and ground_truth
  SimulatorTopics(ros::NodeHandle& handle, double odom_rate_hz);

  /// Once for every simulator: its mounts, and its contacts as they are.
  void begin(const Simulator& simulator);
  /// After every step: what is due. True if the robot has just run into something.
  bool publish(const Simulator& simulator);

 private:
  void publish_state(const Simulator& simulator);
  bool publish_contacts(const ContactCount& now, bool first);

  double odom_rate_hz_;
  ros::Publisher clock_, odometry_, truth_, tf_, tf_static_, people_, collisions_, walker_contacts_, bumper_;
  std::uint64_t steps_ = 0;
  ContactCount contacts_;
};

}  // namespace knav
