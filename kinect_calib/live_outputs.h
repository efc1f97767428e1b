#pragma once

#include <fmt/format.h>
#include <geometry_msgs/Twist.h>
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <unistd.h>

#include <cstdio>
#include <string>

namespace knav {

/// Says stop last, whatever ends the program.
class Commander {
 public:
  explicit Commander(const std::string& topic)
      : publisher_(ros::NodeHandle().advertise<geometry_msgs::Twist>(topic, 5)) {}
  ~Commander() {
    // More than once: the last message of a process that ends may not get out.
    for (int i = 0; i < 5 && ros::ok(); ++i) {
      send(0.0, 0.0);
      ros::WallDuration(0.02).sleep();
    }
  }
  Commander(const Commander&) = delete;
  Commander& operator=(const Commander&) = delete;

  void send(double forward_mps, double turn_radps) {
    geometry_msgs::Twist twist;
    twist.linear.x = forward_mps;
    twist.angular.z = turn_radps;
    publisher_.publish(twist);
  }

 private:
  ros::Publisher publisher_;
};

/// What the robot does, on a topic and, if a person sits there, in one line of the terminal.
class StatusLine {
 public:
  StatusLine() : publisher_(ros::NodeHandle().advertise<std_msgs::String>("calibration_status", 1, true)) {}
  bool on_terminal() const { return terminal_; }
  void show(const std::string& text) {
    const ros::WallTime now = ros::WallTime::now();
    if (text == text_ || (now - shown_).toSec() < 0.2) return;
    text_ = text;
    shown_ = now;
    std_msgs::String message;
    message.data = text;
    publisher_.publish(message);
    if (terminal_) fmt::print(stderr, "\r\033[K{}", text);
  }
  void print(const std::string& line) {
    if (terminal_) fmt::print(stderr, "\r\033[K");
    fmt::print("{}\n", line);
    std::fflush(stdout);
    text_.clear();
  }

 private:
  ros::Publisher publisher_;
  const bool terminal_ = ::isatty(STDERR_FILENO) != 0;
  std::string text_;
  ros::WallTime shown_;
};

}  // namespace knav
