#include "brin_benchmark/external_simulation.h"

#include <ros/master.h>
#include <ros/this_node.h>
#include <ros/time.h>

#include <algorithm>

#include "core/error.h"

namespace knav {
namespace {

constexpr double kOdometryRate_hz = 50.0;
const char* const kClockParameter = "/brin_benchmark/clock_s";

PacingConfig pacing(const ExternalOptions& options) {
  PacingConfig config;
  config.rate = options.rate;
  config.lead_s = options.lead_s;
  config.wait_for_stack = !options.wait_topic.empty();
  return config;
}

}  // namespace

ExternalSimulation::ExternalSimulation(const ExternalOptions& options)
    : options_(options),
      handle_("", options.lidar ? ros::M_string{{"lidar_scan", "scan"}} : ros::M_string{}),
      pacer_(pacing(options)),
      topics_(handle_, kOdometryRate_hz) {
  clock_s_ = handle_.param(kClockParameter, 0.0);
  // actionlib waits for the first /clock, which only this node can send.
  ros::Time::setNow(ros::Time(std::max(1.0, clock_s_)));
  command_ = handle_.subscribe("cmd_vel", 5, &ExternalSimulation::on_command, this, ros::TransportHints().tcpNoDelay());
}

ExternalSimulation::~ExternalSimulation() {
  if (!simulator_) return;
  // Not by the handle: that would wait for a master that has gone.
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  request[1] = kClockParameter;
  request[2] = simulator_->stamp_s();
  ros::master::execute("setParam", request, response, payload, false);
}

void ExternalSimulation::load(const SimulatorConfig& config, const WorldConfig& world) {
  SimulatorNodeConfig node_config;
  static_cast<SimulatorConfig&>(node_config) = config;
  node_config.start_time_s = std::max(config.start_time_s, simulator_ ? simulator_->stamp_s() : clock_s_);
  auto next = std::make_unique<Simulator>(world, node_config);
  renderer_.reset();  // it may be rendering the old building
  if (frames_) {
    frames_->show(*next);
  } else {
    frames_ = std::make_unique<FramePublisher>(handle_, *next, node_config);
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (simulator_) next->set_odometry(simulator_->T_odom_base());
    simulator_ = std::move(next);
  }
  if (!pacer_.config().waits()) renderer_ = std::make_unique<FrameThread>(*frames_);
  topics_.begin(*simulator_);
}

bool ExternalSimulation::set_pose(const Pose2& T_world_base) {
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    simulator_->set_pose(T_world_base);
  } catch (const UserError&) {
    return false;  // something stands there
  }
  return true;
}

void ExternalSimulation::step(bool has_goal) {
  bool frame_due = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    simulator_->step();
    frame_due = simulator_->next_frame(&request_);
  }
  topics_.publish(*simulator_);
  if (frame_due && frames_->anybody_listens()) {
    if (renderer_) {
      renderer_->post(request_);
    } else {
      frames_->publish(request_);
    }
  }
  pacer_.wait(simulator_->stamp_s(), has_goal);
}

double ExternalSimulation::frames_dropped() const {
  if (!renderer_) return 0.0;
  const auto dropped = static_cast<double>(renderer_->dropped());
  return dropped > 0.0 ? dropped / (dropped + static_cast<double>(renderer_->rendered())) : 0.0;
}

void ExternalSimulation::on_command(const geometry_msgs::Twist::ConstPtr& message) {
  double now_s = 0.0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!simulator_) return;
    simulator_->set_command(message->linear.x, message->angular.z);
    now_s = simulator_->stamp_s();
  }
  pacer_.heard(ClockPacer::kCommand, now_s);
}

}  // namespace knav
