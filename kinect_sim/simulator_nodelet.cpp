#include <diagnostic_msgs/DiagnosticArray.h>
#include <fmt/format.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Twist.h>
#include <rosgraph_msgs/Clock.h>
#include <std_msgs/Bool.h>
#include <std_msgs/String.h>
#include <std_msgs/UInt32.h>
#include <std_srvs/Empty.h>
#include <std_srvs/SetBool.h>
#include <tf2_msgs/TFMessage.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <pluginlib/class_list_macros.hpp>
#include <thread>

#include "core/error.h"
#include "kinect_sim/frame_publisher.h"
#include "kinect_sim/sim_messages.h"
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
    {
      const std::lock_guard<std::mutex> lock(job_mutex_);
      job_posted_.notify_all();
    }
    if (step_thread_.joinable()) step_thread_.join();
    if (render_thread_.joinable()) render_thread_.join();
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
    clock_ = handle.advertise<rosgraph_msgs::Clock>("/clock", 20);
    odometry_ = handle.advertise<nav_msgs::Odometry>("odom", 50);
    truth_ = handle.advertise<nav_msgs::Odometry>("ground_truth", 50);
    tf_ = handle.advertise<tf2_msgs::TFMessage>("/tf", 100);
    tf_static_ = handle.advertise<tf2_msgs::TFMessage>("/tf_static", 10, true);
    people_ = handle.advertise<visualization_msgs::MarkerArray>("people", 5);
    collisions_ = handle.advertise<std_msgs::UInt32>("collisions", 5, true);
    walker_contacts_ = handle.advertise<std_msgs::UInt32>("walker_contacts", 5, true);
    bumper_ = handle.advertise<std_msgs::Bool>("bumper", 5, true);
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
    publish_mounts();
    publish_contacts(true);
    lockstep_ = config_.mode == "lockstep";
    if (lockstep_) {
      waiter_ = std::make_unique<StampWaiter>(handle, config_.wait_topic);
    } else {
      render_thread_ = std::thread([this] { render_loop(); });
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
    ++steps_;
    if (steps_ % 2 == 0) {
      rosgraph_msgs::Clock clock;
      clock.clock.fromSec(simulator_->stamp_s());
      clock_.publish(clock);
    }
    const auto every =
        static_cast<std::uint64_t>(std::max(1L, std::lround(1.0 / (config_.odom_rate_hz * config_.step_s))));
    if (steps_ % every == 0) publish_state();
    publish_contacts(false);
    if (frame_due) hand_over_frame();
  }

  void publish_state() {
    odometry_.publish(odometry_message(*simulator_));
    tf2_msgs::TFMessage tf;
    tf.transforms.push_back(odometry_transform(*simulator_));
    tf_.publish(tf);
    truth_.publish(ground_truth_message(*simulator_));
    if (people_.getNumSubscribers() > 0 && steps_ % 25 == 0) people_.publish(people_message(*simulator_));
  }

  void publish_mounts() {
    tf2_msgs::TFMessage tf;
    tf.transforms = mount_transforms(*simulator_);
    tf_static_.publish(tf);
  }

  void publish_contacts(bool first) {
    const ContactCount now = simulator_->contacts();
    const auto publish_count = [](ros::Publisher& publisher, std::uint32_t count) {
      std_msgs::UInt32 message;
      message.data = count;
      publisher.publish(message);
    };
    if (first || now.collisions != contacts_.collisions) publish_count(collisions_, now.collisions);
    if (first || now.walker_contacts != contacts_.walker_contacts)
      publish_count(walker_contacts_, now.walker_contacts);
    if (first || now.touching != contacts_.touching) {
      std_msgs::Bool message;
      message.data = now.touching;
      bumper_.publish(message);
    }
    if (now.collisions > contacts_.collisions) {
      const Pose2& at = simulator_->T_world_base();
      NODELET_WARN("The robot ran into something at [%.2f, %.2f].", at.x_m, at.y_m);
    }
    contacts_ = now;
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
    const std::lock_guard<std::mutex> lock(job_mutex_);
    if (busy_) {
      ++dropped_;
      return;
    }
    std::swap(job_, next_request_);
    busy_ = true;
    job_posted_.notify_one();
  }

  void render_loop() {
    while (true) {
      std::unique_lock<std::mutex> lock(job_mutex_);
      job_posted_.wait(lock, [&] { return stop_ || busy_; });
      if (stop_) return;
      lock.unlock();
      const Wall::time_point before = Wall::now();
      frames_->publish(job_);
      render_ns_ += std::chrono::duration_cast<std::chrono::nanoseconds>(Wall::now() - before).count();
      ++rendered_;
      lock.lock();
      busy_ = false;
    }
  }

  void report(Wall::time_point now) {
    if (now - window_wall_ < std::chrono::seconds(1)) return;
    const auto seconds = [](Wall::duration d) { return std::chrono::duration<double>(d).count(); };
    const double stamp_s = simulator_->stamp_s();
    const double recent = (stamp_s - window_s_) / seconds(now - window_wall_);
    const double overall = (stamp_s - start_s_) / seconds(now - start_wall_);
    const std::uint64_t rendered = rendered_, dropped = dropped_;
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
    const double render_ms =
        rendered ? 1e-6 * static_cast<double>(render_ns_) / static_cast<double>(rendered) : 0.0;
    add("render_wall_ms", fmt::format("{:.2f}", render_ms));
    add("lockstep_timeouts", std::to_string(timeouts_));
    add("collisions", std::to_string(contacts_.collisions));
    add("walker_contacts", std::to_string(contacts_.walker_contacts));
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
  ros::Publisher clock_, odometry_, truth_, tf_, tf_static_, people_, collisions_, walker_contacts_, bumper_,
      diagnostics_, statistics_;
  ros::Subscriber command_, set_pose_;
  ros::ServiceServer reset_, plug_, stream_;
  bool lockstep_ = false;
  std::mutex state_mutex_;  ///< the simulator's state, against commands from ROS
  FrameRequest next_request_;
  std::uint64_t steps_ = 0;
  ContactCount contacts_;

  std::mutex job_mutex_;  ///< busy_ and job_
  std::condition_variable job_posted_;
  FrameRequest job_;
  bool busy_ = false;

  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> rendered_{0};
  std::atomic<std::int64_t> render_ns_{0};
  std::uint64_t dropped_ = 0, timeouts_ = 0;
  Wall::time_point start_wall_, window_wall_;
  double start_s_ = 0.0, window_s_ = 0.0;
  std::thread step_thread_, render_thread_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::SimulatorNodelet, nodelet::Nodelet)
