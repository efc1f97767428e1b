#pragma once

#include <string>
#include <vector>

namespace knav {

struct KeyboardDriveConfig {
  double speed_mps = 0.4;
  double turn_radps = 0.5;
  double acceleration_mps2 = 0.8;
  double turn_acceleration_radps2 = 2.0;
  double hold_s = 0.6;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("speed_mps", speed_mps, 0.05, 2, "m/s", "Speed of a key that is held.");
    v.number("turn_radps", turn_radps, 0.05, 3, "rad/s", "Turning speed of a key that is held.");
    v.number("acceleration_mps2", acceleration_mps2, 0.05, 10, "m/s^2", "Speeds change no faster.");
    v.number("turn_acceleration_radps2", turn_acceleration_radps2, 0.05, 20, "rad/s^2", "Likewise.");
    v.number("hold_s", hold_s, 0.1, 5, "s",
             "The robot stops so long after the last key: a terminal repeats a held key, first after about "
             "0.5 s.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// From a terminal's bytes to speeds: arrows or w a s d drive while held, space stops at once, m marks a
/// place,
/// + and - change the speeds by a tenth, q or Ctrl-C ends.
class KeyboardDrive {
 public:
  explicit KeyboardDrive(const KeyboardDriveConfig& config) : config_(config) {}

  struct Speeds {
    double forward_mps = 0.0, turn_radps = 0.0;
  };
  /// @param bytes what the terminal gave since the last call
  /// @return the speeds to command now
  Speeds update(double now_s, const std::string& bytes);

  int take_marks();  ///< pressed since the last call
  bool ended() const { return ended_; }
  double scale() const { return scale_; }

 private:
  struct Axis {
    int direction = 0;
    double pressed_s = -1e300;
  };
  void key(double now_s, char key);
  double approach(double from, double to, double most) const;

  KeyboardDriveConfig config_;
  Axis forward_, turn_;
  Speeds speeds_;
  std::string unfinished_;  ///< an arrow's escape sequence that came in parts
  double last_s_ = -1e300, scale_ = 1.0;
  int marks_ = 0;
  bool ended_ = false;
};

}  // namespace knav
