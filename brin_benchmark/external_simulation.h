#pragma once

#include <geometry_msgs/Twist.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <memory>
#include <mutex>

#include "brin_benchmark/clock_pacer.h"
#include "brin_benchmark/external_options.h"
#include "kinect_sim/frame_publisher.h"
#include "kinect_sim/frame_thread.h"
#include "kinect_sim/simulator_topics.h"

namespace knav {

/// The building and the robot's body as topics, one building after the other: the clock and odometry go on from run to
/// run, and from one start of the benchmark to the next on the same ROS master, as no stack likes them to jump.
class ExternalSimulation {
 public:
  explicit ExternalSimulation(const ExternalOptions& options);
  ~ExternalSimulation();

  /// The robot stands at the start of this building.
  void load(const SimulatorConfig& config, const WorldConfig& world);
  /// Puts the robot elsewhere; odometry does not notice. False if something stands there.
  bool set_pose(const Pose2& T_world_base);

  /// One physics step, its topics, and the wait that pacing asks for.
  /// @param has_goal  velocity commands are expected
  void step(bool has_goal);

  const Simulator& simulator() const { return *simulator_; }
  ClockPacer& pacer() { return pacer_; }
  bool commands_come() const { return command_.getNumPublishers() > 0; }
  std::string command_topic() const { return command_.getTopic(); }
  /// Share of this building's depth frames so far.
  double frames_dropped() const;

 private:
  void on_command(const geometry_msgs::Twist::ConstPtr& message);

  ExternalOptions options_;
  ros::NodeHandle handle_;
  ClockPacer pacer_;
  SimulatorTopics topics_;
  std::unique_ptr<Simulator> simulator_;
  std::unique_ptr<FramePublisher> frames_;
  std::unique_ptr<FrameThread> renderer_;  ///< where time does not wait for frames
  FrameRequest request_;
  double clock_s_ = 0.0;  ///< at which the next building begins
  std::mutex mutex_;  ///< the simulator's state, against commands
  ros::Subscriber command_;
};

}  // namespace knav
