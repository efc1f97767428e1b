#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// One thing a driver does.
struct TourStep {
  enum class Kind { kDrive, kTurn, kFace, kWait, kMark };
  Kind kind = Kind::kWait;
  std::vector<Point2> path;  ///< kDrive, world frame
  double value = 0.0;        ///< kTurn [rad], kFace [rad], kWait [s]
  double speed_mps = 0.0;    ///< kDrive; 0 = the script's
  std::string name;          ///< kMark
};

/// What a person with a joystick is to do, from YAML (docs/simulator.md has the keys).
struct TourScript {
  std::string file;
  double speed_mps = 0.6;
  double turn_radps = 0.8;
  std::vector<TourStep> steps;
  double length_m() const;
};

/// UserError, one sentence with file and key.
TourScript load_tour(const std::string& path);
TourScript parse_tour(const std::string& text, const std::string& file_name);

/// Follows a script by looking at the true pose, as a human driver looks at the floor. Deterministic.
class TourDriver {
 public:
  explicit TourDriver(const TourScript& script) : script_(script) {}

  struct Command {
    double v_mps = 0.0;
    double w_radps = 0.0;
    std::optional<std::string> mark;  ///< the button is pressed now
    bool done = false;
    bool stuck = false;  ///< no headway for 30 s
  };
  Command step(double now_s, const Pose2& T_world_robot);
  /// Share of the script's way done, in [0, 1].
  double progress() const;

 private:
  Command drive(const TourStep& step, const Pose2& robot, double dt_s);
  Command turn_to(double yaw_rad, const Pose2& robot);
  void next_step();
  void watch_headway(double now_s, const Pose2& robot, Command* command);

  TourScript script_;
  std::size_t index_ = 0;
  bool started_ = false, marked_ = false;
  double step_start_s_ = 0.0, last_s_ = 0.0, travelled_m_ = 0.0, v_mps_ = 0.0;
  double turned_rad_ = 0.0, last_yaw_rad_ = 0.0;
  std::vector<Point2> path_;
  double along_m_ = 0.0;
  Pose2 headway_pose_, last_pose_;
  double headway_s_ = 0.0;
  bool any_ = false;
};

}  // namespace knav
