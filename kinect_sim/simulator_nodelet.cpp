#include <diagnostic_msgs/DiagnosticArray.h>
#include <fmt/format.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Twist.h>
#include <std_msgs/String.h>
#include <std_srvs/Empty.h>
#include <std_srvs/SetBool.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <pluginlib/class_list_macros.hpp>
#include <thread>

#include "core/error.h"
#include "kinect_sim/frame_publisher.h"
#include "kinect_sim/frame_thread.h"
#include "kinect_sim/simulator_topics.h"
#include "kinect_sim/stamp_waiter.h"
#include "ros_common/conversions.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/parameters.h"

namespace knav {

/// The simulated robot as topics. One thread steps the world and keeps the clock; another renders, and when
/// it is late, frames are dropped and counted while time goes on. In lock-step one thread does both and
/// waits.
class SimulatorNodelet : public NodeletBase {
 public:
  ~SimulatorNodelet() override {
    stop_ = true;
    if (waiter_) waiter_->stop();
    if (step_thread_.joinable()) step_thread_.join();
  }

 private:
  using Wall = std::chrono::steady_clock;

  void start() override {
    config_ = read_parameters<SimulatorNodeConfig>(getPrivateNodeHandle());
    if (config_.world.empty()) {
      throw UserError(getPrivateNodeHandle().getNamespace() +
                      ": 'world' is missing; give the path of a world file.");
    }
    simulator_ = std::make_unique<Simulator>(load_world(config_.world), config_);
    ros::NodeHandle& handle = getNodeHandle();
    frames_ = std::make_unique<FramePublisher>(handle, *simulator_, config_);
    topics_ = std::make_unique<SimulatorTopics>(handle, config_.odom_rate_hz);
    diagnostics_ = handle.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 5);
    statistics_ = getPrivateNodeHandle().advertise<std_msgs::String>("statistics", 5, true);
    command_ = handle.subscribe<geometry_msgs::Twist>("cmd_vel", 5, &SimulatorNodelet::on_command, this);
    set_pose_ =
        handle.subscribe<geometry_msgs::PoseStamped>("set_pose", 5, &SimulatorNodelet::on_set_pose, this);
    reset_ = getPrivateNodeHandle().advertiseService("reset", &SimulatorNodelet::on_reset, this);
    if (frames_->openni2() != nullptr) {
      plug_ = getPrivateNodeHandle().advertiseService("set_plugged", &SimulatorNodelet::on_set_plugged, this);
      stream_ = getPrivateNodeHandle().advertiseService("set_streaming", &SimulatorNodelet::on_set_streaming, this);
      NODELET_INFO("The Kinect is the OpenNI2 device kinect_nav_simulated/%s.", config_.openni2_device.c_str());
    }
    topics_->begin(*simulator_);
    lockstep_ = config_.mode == "lockstep";
    if (lockstep_) {
      waiter_ = std::make_unique<StampWaiter>(handle, config_.wait_topic);
    } else {
      renderer_ = std::make_unique<FrameThread>(*frames_);
    }
    step_thread_ = std::thread([this] { step_loop(); });
    NODELET_INFO("Simulating %s (%s), sensor '%s', odometry '%s'.", simulator_->world().name.c_str(),
                 config_.mode.c_str(), config_.sensor.c_str(), config_.odometry.c_str());
  }

  void on_command(const geometry_msgs::Twist::ConstPtr& message) {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    simulator_->set_command(message->linear.x, message->angular.z);
  }

  void on_set_pose(const geometry_msgs::PoseStamped::ConstPtr& message) {
    try {
      const std::lock_guard<std::mutex> lock(state_mutex_);
      simulator_->set_pose(pose2_from(message->pose));
    } catch (const UserError& error) {
      NODELET_ERROR("%s", error.what());
    }
  }

  bool on_reset(std_srvs::Empty::Request&, std_srvs::Empty::Response&) {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    simulator_->reset();
    return true;
  }

  bool on_set_plugged(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
    frames_->openni2()->set_plugged(request.data);
    response.success = true;
    response.message = request.data ? "plugged in" : "unplugged";
    return true;
  }

  bool on_set_streaming(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
    frames_->openni2()->set_streaming(request.data);
    response.success = true;
    response.message = request.data ? "sends frames" : "connected, but silent";
    return true;
  }

  void step_loop() {
    const auto step =
        std::chrono::duration_cast<Wall::duration>(std::chrono::duration<double>(config_.step_s));
    Wall::time_point due = Wall::now();
    start_wall_ = window_wall_ = due;
    start_s_ = window_s_ = simulator_->stamp_s();
    while (!stop_ && ros::ok()) {
      one_step();
      due += step;
      const Wall::time_point now = Wall::now();
      if (lockstep_) {
        if (due < now) due = now;  // never faster than real time, and no hurry after a wait
      } else if (now - due > std::chrono::milliseconds(200)) {
        due = now;  // time that is lost stays lost: the real-time factor tells
      }
      report(now);
      std::this_thread::sleep_until(due);
    }
  }

  void one_step() {
    bool frame_due = false;
    if (frames_->openni2() != nullptr) frames_->openni2()->keep_alive();
    {
      const std::lock_guard<std::mutex> lock(state_mutex_);
      simulator_->step();
      frame_due = simulator_->next_frame(&next_request_);
    }
    if (topics_->publish(*simulator_)) {
      const Pose2& at = simulator_->T_world_base();
      NODELET_WARN("The robot ran into something at [%.2f, %.2f].", at.x_m, at.y_m);
    }
    if (frame_due) hand_over_frame();
  }

  void hand_over_frame() {
    if (!frames_->anybody_listens()) return;
    if (lockstep_) {
      frames_->publish(next_request_);
      ++rendered_;
      if (frames_->depth_is_wanted() && !waiter_->wait_for(next_request_.stamp_s, config_.wait_limit_s) &&
          !stop_) {
        ++timeouts_;
        NODELET_WARN_THROTTLE(10.0, "lockstep: no answer on '%s' within %.2f s; going on.",
                              config_.wait_topic.c_str(), config_.wait_limit_s);
      }
      return;
    }
    renderer_->post(next_request_);
  }

  void report(Wall::time_point now) {
    if (now - window_wall_ < std::chrono::seconds(1)) return;
    const auto seconds = [](Wall::duration d) { return std::chrono::duration<double>(d).count(); };
    const double stamp_s = simulator_->stamp_s();
    const double recent = (stamp_s - window_s_) / seconds(now - window_wall_);
    const double overall = (stamp_s - start_s_) / seconds(now - start_wall_);
    const std::uint64_t rendered = renderer_ ? renderer_->rendered() : rendered_;
    const std::uint64_t dropped = renderer_ ? renderer_->dropped() : 0;
    diagnostic_msgs::DiagnosticArray array;
    array.header.stamp.fromSec(stamp_s);
    diagnostic_msgs::DiagnosticStatus status;
    status.name = "simulator";
    status.hardware_id = simulator_->world().name;
    const bool slow = !lockstep_ && recent < 0.95;
    status.level = slow ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK;
    status.message = slow ? "slower than real time" : "running";
    const auto add = [&](const char* key, const std::string& value) {
      diagnostic_msgs::KeyValue pair;
      pair.key = key;
      pair.value = value;
      status.values.push_back(pair);
    };
    add("real_time_factor", fmt::format("{:.4f}", overall));
    add("real_time_factor_recent", fmt::format("{:.4f}", recent));
    add("rendered_frames", std::to_string(rendered));
    add("dropped_frames", std::to_string(dropped));
    const std::uint64_t all = rendered + dropped;
    add("dropped_frames_fraction",
        fmt::format("{:.5f}", all ? static_cast<double>(dropped) / static_cast<double>(all) : 0.0));
    add("render_wall_ms", fmt::format("{:.2f}", renderer_ ? renderer_->render_ms() : 0.0));
    add("lockstep_timeouts", std::to_string(timeouts_));
    const ContactCount contacts = simulator_->contacts();
    add("collisions", std::to_string(contacts.collisions));
    add("walker_contacts", std::to_string(contacts.walker_contacts));
    add("distance_driven_m", fmt::format("{:.2f}", simulator_->distance_driven_m()));
    array.status.push_back(status);
    diagnostics_.publish(array);
    std_msgs::String statistics;
    for (const auto& pair : status.values) {
      statistics.data += (statistics.data.empty() ? "{\"" : ", \"") + pair.key + "\": " + pair.value;
    }
    statistics.data += "}";
    statistics_.publish(statistics);
    window_wall_ = now;
    window_s_ = stamp_s;
  }

  SimulatorNodeConfig config_;
  std::unique_ptr<Simulator> simulator_;
  std::unique_ptr<FramePublisher> frames_;
  std::unique_ptr<StampWaiter> waiter_;
  std::unique_ptr<FrameThread> renderer_;  ///< in real time
  std::unique_ptr<SimulatorTopics> topics_;
  ros::Publisher diagnostics_, statistics_;
  ros::Subscriber command_, set_pose_;
  ros::ServiceServer reset_, plug_, stream_;
  bool lockstep_ = false;
  std::mutex state_mutex_;  ///< the simulator's state, against commands from ROS
  FrameRequest next_request_;
  std::atomic<bool> stop_{false};
  std::uint64_t rendered_ = 0, timeouts_ = 0;  ///< in lock-step
  Wall::time_point start_wall_, window_wall_;
  double start_s_ = 0.0, window_s_ = 0.0;
  std::thread step_thread_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::SimulatorNodelet, nodelet::Nodelet)
