#include "kinect_sim/simulator_topics.h"

#include <rosgraph_msgs/Clock.h>
#include <std_msgs/Bool.h>
#include <std_msgs/UInt32.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>

#include "kinect_sim/sim_messages.h"

namespace knav {

SimulatorTopics::SimulatorTopics(ros::NodeHandle& handle, double odom_rate_hz) : odom_rate_hz_(odom_rate_hz) {
  clock_ = handle.advertise<rosgraph_msgs::Clock>("/clock", 20);
  odometry_ = handle.advertise<nav_msgs::Odometry>("odom", 50);
  truth_ = handle.advertise<nav_msgs::Odometry>("ground_truth", 50);
  tf_ = handle.advertise<tf2_msgs::TFMessage>("/tf", 100);
  tf_static_ = handle.advertise<tf2_msgs::TFMessage>("/tf_static", 10, true);
  people_ = handle.advertise<visualization_msgs::MarkerArray>("people", 5);
  collisions_ = handle.advertise<std_msgs::UInt32>("collisions", 5, true);
  walker_contacts_ = handle.advertise<std_msgs::UInt32>("walker_contacts", 5, true);
  bumper_ = handle.advertise<std_msgs::Bool>("bumper", 5, true);
}

void SimulatorTopics::begin(const Simulator& simulator) {
  tf2_msgs::TFMessage tf;
  tf.transforms = mount_transforms(simulator);
  tf_static_.publish(tf);
  publish_contacts(simulator.contacts(), true);
}

bool SimulatorTopics::publish(const Simulator& simulator) {
  ++steps_;
  if (steps_ % 2 == 0) {
    rosgraph_msgs::Clock clock;
    clock.clock.fromSec(simulator.stamp_s());
    clock_.publish(clock);
  }
  const auto every = static_cast<std::uint64_t>(
      std::max(1L, std::lround(1.0 / (odom_rate_hz_ * simulator.config().step_s))));
  if (steps_ % every == 0) publish_state(simulator);
  return publish_contacts(simulator.contacts(), false);
}

void SimulatorTopics::publish_state(const Simulator& simulator) {
  odometry_.publish(odometry_message(simulator));
  tf2_msgs::TFMessage tf;
  tf.transforms.push_back(odometry_transform(simulator));
  tf_.publish(tf);
  truth_.publish(ground_truth_message(simulator));
  if (people_.getNumSubscribers() > 0 && steps_ % 25 == 0) people_.publish(people_message(simulator));
}

bool SimulatorTopics::publish_contacts(const ContactCount& now, bool first) {
  const auto publish_count = [](ros::Publisher& publisher, std::uint32_t count) {
    std_msgs::UInt32 message;
    message.data = count;
    publisher.publish(message);
  };
  if (first || now.collisions != contacts_.collisions) publish_count(collisions_, now.collisions);
  if (first || now.walker_contacts != contacts_.walker_contacts) publish_count(walker_contacts_, now.walker_contacts);
  if (first || now.touching != contacts_.touching) {
    std_msgs::Bool message;
    message.data = now.touching;
    bumper_.publish(message);
  }
  const bool collided = now.collisions > contacts_.collisions;
  contacts_ = now;
  return collided && !first;
}

}  // namespace knav
