#include "global_map_builder/keyboard_drive.h"

#include <algorithm>

namespace knav {

double KeyboardDrive::approach(double from, double to, double most) const {
  return from + std::clamp(to - from, -most, most);
}

void KeyboardDrive::key(double now_s, char key) {
  const auto press = [now_s](Axis* axis, int direction) { *axis = {direction, now_s}; };
  switch (key) {
    case 'w':
    case 'W':
      press(&forward_, 1);
      break;
    case 's':
    case 'S':
      press(&forward_, -1);
      break;
    case 'a':
    case 'A':
      press(&turn_, 1);
      break;
    case 'd':
    case 'D':
      press(&turn_, -1);
      break;
    case ' ':
      forward_ = turn_ = {};
      speeds_ = {};
      break;
    case 'm':
    case 'M':
      ++marks_;
      break;
    case '+':
    case '=':
      scale_ = std::min(2.0, scale_ + 0.1);
      break;
    case '-':
      scale_ = std::max(0.1, scale_ - 0.1);
      break;
    case 'q':
    case 'Q':
    case '\x03':
      ended_ = true;
      break;
    default:
      break;
  }
}

KeyboardDrive::Speeds KeyboardDrive::update(double now_s, const std::string& bytes) {
  const std::string all = unfinished_ + bytes;
  unfinished_.clear();
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i] != '\x1b') {
      key(now_s, all[i]);
      continue;
    }
    if (i + 2 >= all.size()) {  // the rest comes with the next bytes
      unfinished_ = all.substr(i);
      break;
    }
    // ESC [ A or ESC O A: up, down, right, left.
    static const std::string kArrows = "ABCD", kKeys = "wsda";
    const auto arrow = kArrows.find(all[i + 2]);
    if ((all[i + 1] == '[' || all[i + 1] == 'O') && arrow != std::string::npos) key(now_s, kKeys[arrow]);
    i += 2;
  }
  const double step_s = std::clamp(now_s - last_s_, 0.0, 0.2);
  last_s_ = now_s;
  const auto held = [&](const Axis& axis) {
    return now_s - axis.pressed_s < config_.hold_s ? axis.direction : 0;
  };
  const double forward = held(forward_) * config_.speed_mps * scale_;
  const double turn = held(turn_) * config_.turn_radps * scale_;
  speeds_.forward_mps = approach(speeds_.forward_mps, forward, config_.acceleration_mps2 * step_s);
  speeds_.turn_radps = approach(speeds_.turn_radps, turn, config_.turn_acceleration_radps2 * step_s);
  if (ended_) speeds_ = {};
  return speeds_;
}

int KeyboardDrive::take_marks() {
  const int marks = marks_;
  marks_ = 0;
  return marks;
}

}  // namespace knav
