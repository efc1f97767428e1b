// keyboard_teleop: drives a robot from a terminal, with a key that marks places for the map.
#include <fmt/format.h>
#include <geometry_msgs/Twist.h>
#include <ros/ros.h>
#include <std_msgs/Empty.h>
#include <termios.h>
#include <unistd.h>

#include "core/error.h"
#include "global_map_builder/keyboard_drive.h"
#include "ros_common/command_line.h"
#include "ros_common/parameters.h"

namespace knav {
namespace {

/// Keys as they are pressed, without echo; the terminal is put back at the end.
class RawTerminal {
 public:
  RawTerminal() {
    if (isatty(STDIN_FILENO) == 0 || tcgetattr(STDIN_FILENO, &before_) != 0) {
      throw UserError(
          "keys can only be read from a terminal; under roslaunch add launch-prefix=\"xterm -e\".");
    }
    termios raw = before_;
    raw.c_lflag &= static_cast<tcflag_t>(~(ICANON | ECHO));
    raw.c_cc[VMIN] = 0;
    raw.c_cc[VTIME] = 0;
    tcsetattr(STDIN_FILENO, TCSANOW, &raw);
  }
  ~RawTerminal() { tcsetattr(STDIN_FILENO, TCSANOW, &before_); }
  RawTerminal(const RawTerminal&) = delete;
  RawTerminal& operator=(const RawTerminal&) = delete;

  std::string read_keys() const {
    char bytes[64];
    const ssize_t count = read(STDIN_FILENO, bytes, sizeof bytes);
    return count > 0 ? std::string(bytes, static_cast<std::size_t>(count)) : std::string();
  }

 private:
  termios before_{};
};

void drive() {
  const RawTerminal terminal;
  if (!ros::master::check()) throw UserError("no ROS master answers; start roscore or set ROS_MASTER_URI.");
  ros::NodeHandle node;
  KeyboardDrive keyboard(read_parameters<KeyboardDriveConfig>(ros::NodeHandle("~")));
  ros::Publisher speeds = node.advertise<geometry_msgs::Twist>("cmd_vel", 1);
  ros::Publisher marks = node.advertise<std_msgs::Empty>("mark_place", 10);
  fmt::print(
      "arrows or w a s d: drive while held   space: stop   m: mark this place   + -: speed   q: end\n");
  int marked = 0;
  bool moving = false;
  while (ros::ok() && !keyboard.ended() && !interrupted()) {
    // Wall time: keys are pressed by a person, and a simulator may stand still.
    const KeyboardDrive::Speeds now = keyboard.update(ros::WallTime::now().toSec(), terminal.read_keys());
    for (int i = keyboard.take_marks(); i > 0; --i) {
      marks.publish(std_msgs::Empty());
      fmt::print("\rplace marked: {}      \n", ++marked);
    }
    geometry_msgs::Twist message;
    message.linear.x = now.forward_mps;
    message.angular.z = now.turn_radps;
    const bool moves = now.forward_mps != 0.0 || now.turn_radps != 0.0;
    // At rest nothing is sent but the stop, so that others can drive meanwhile.
    if (moves || moving) speeds.publish(message);
    moving = moves;
    fmt::print("\r{:5.2f} m/s {:5.2f} rad/s ", now.forward_mps, now.turn_radps);
    std::fflush(stdout);
    ros::WallDuration(0.05).sleep();
  }
  speeds.publish(geometry_msgs::Twist());
  ros::WallDuration(0.1).sleep();
  fmt::print("\n");
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  ros::init(argc, argv, "keyboard_teleop", ros::init_options::NoSigintHandler);
  CLI::App app(
      "Drives a robot from a terminal: publishes cmd_vel (geometry_msgs/Twist) while a key is held, and "
      "mark_place\n"
      "(std_msgs/Empty) for the map builder. Speeds are private parameters (_speed_mps:=0.3); topics can be "
      "remapped.");
  app.allow_extras();
  return knav::run_command(app, argc, argv, [] { knav::drive(); });
}
