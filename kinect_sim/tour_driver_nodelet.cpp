#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <std_msgs/Bool.h>
#include <std_msgs/Empty.h>
#include <std_msgs/Float32.h>
#include <topic_tools/shape_shifter.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "core/error.h"
#include "kinect_sim/tour.h"
#include "kinect_sim/tour_driver_config.h"
#include "ros_common/conversions.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/parameters.h"

namespace knav {

/// A person with a joystick: drives a script on the true pose and presses the button at its marks.
class TourDriverNodelet : public NodeletBase {
  void start() override {
    config_ = read_parameters<TourDriverConfig>(getPrivateNodeHandle());
    if (config_.script.empty()) {
      throw UserError(getPrivateNodeHandle().getNamespace() +
                      ": 'script' is missing; give the path of a tour script.");
    }
    driver_ = std::make_unique<TourDriver>(load_tour(config_.script));
    ros::NodeHandle& handle = getNodeHandle();
    command_ = handle.advertise<geometry_msgs::Twist>("cmd_vel", 5);
    mark_ = handle.advertise<std_msgs::Empty>("mark_place", 5);
    done_ = handle.advertise<std_msgs::Bool>("tour_done", 2, true);
    progress_ = handle.advertise<std_msgs::Float32>("tour_progress", 5);
    may_start_ = config_.start_after.empty();
    if (!may_start_) {
      trigger_ = handle.subscribe<topic_tools::ShapeShifter>(
          config_.start_after, 1, [this](const topic_tools::ShapeShifter::ConstPtr&) {
            may_start_ = true;
            trigger_.shutdown();
          });
    }
    truth_ = handle.subscribe<nav_msgs::Odometry>("ground_truth", 5, &TourDriverNodelet::on_truth, this);
  }

  void on_truth(const nav_msgs::Odometry::ConstPtr& message) {
    const double now_s = message->header.stamp.toSec();
    if (!may_start_ || finished_) return;
    if (start_s_ < 0.0) start_s_ = now_s + config_.start_delay_s;
    if (now_s < start_s_) return;
    const TourDriver::Command command = driver_->step(now_s, pose2_from(message->pose.pose));
    geometry_msgs::Twist twist;
    twist.linear.x = command.v_mps;
    twist.angular.z = command.w_radps;
    command_.publish(twist);
    if (command.mark) mark_.publish(std_msgs::Empty());
    if (++messages_ % 50 == 0) {
      std_msgs::Float32 progress;
      progress.data = static_cast<float>(driver_->progress());
      progress_.publish(progress);
    }
    if (command.stuck) NODELET_WARN_THROTTLE(10.0, "tour: no headway for 30 s.");
    if (command.done) {
      finished_ = true;
      std_msgs::Bool done;
      done.data = 1;
      done_.publish(done);
      NODELET_INFO("tour: done.");
    }
  }

  TourDriverConfig config_;
  std::unique_ptr<TourDriver> driver_;
  ros::Publisher command_, mark_, done_, progress_;
  ros::Subscriber truth_, trigger_;
  double start_s_ = -1.0;
  std::uint64_t messages_ = 0;
  bool may_start_ = false, finished_ = false;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::TourDriverNodelet, nodelet::Nodelet)
