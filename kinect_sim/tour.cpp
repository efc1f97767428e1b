#include "kinect_sim/tour.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/config.h"
#include "core/error.h"
#include "kinect_sim/solid.h"
#include "kinect_sim/yaml_map.h"

namespace knav {
namespace {

constexpr double kDegree = kPi / 180.0;
constexpr double kLookAhead_m = 0.45;
constexpr double kArrived_m = 0.06;
constexpr double kStuck_s = 30.0;

double length(const Point2& a, const Point2& b) { return std::hypot(b.x_m - a.x_m, b.y_m - a.y_m); }

double length(const std::vector<Point2>& path) {
  double sum = 0.0;
  for (std::size_t i = 0; i + 1 < path.size(); ++i) sum += length(path[i], path[i + 1]);
  return sum;
}

Point2 point_along(const std::vector<Point2>& path, double s) {
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    const double l = length(path[i], path[i + 1]);
    if (s <= l || i + 2 == path.size()) {
      const double t = l > 0.0 ? std::clamp(s / l, 0.0, 1.0) : 1.0;
      return {path[i].x_m + t * (path[i + 1].x_m - path[i].x_m),
              path[i].y_m + t * (path[i + 1].y_m - path[i].y_m)};
    }
    s -= l;
  }
  return path.back();
}

/// The nearest place on the path, not behind `from_m` nor more than a metre ahead of it.
double project(const std::vector<Point2>& path, const Point2& robot, double from_m) {
  double best_s = from_m, best_m = std::numeric_limits<double>::infinity();
  for (double s = from_m; s <= from_m + 1.0; s += 0.02) {
    const double d = length(point_along(path, s), robot);
    if (d < best_m) {
      best_m = d;
      best_s = s;
    }
  }
  return best_s;
}

TourStep read_step(YamlMap& map) {
  TourStep step;
  int kinds = 0;
  if (map.has("drive")) {
    step.kind = TourStep::Kind::kDrive;
    step.path = map.points("drive");
    if (step.path.empty()) map.fail("drive", "must name at least one point");
    step.speed_mps = map.number("speed_mps", 0.02, 2, 0.0);
    ++kinds;
  }
  if (map.has("turn")) {
    step.kind = TourStep::Kind::kTurn;
    step.value = map.number("turn", -3600, 3600) * kDegree;
    ++kinds;
  }
  if (map.has("face")) {
    step.kind = TourStep::Kind::kFace;
    step.value = map.number("face", -360, 360) * kDegree;
    ++kinds;
  }
  if (map.has("wait")) {
    step.kind = TourStep::Kind::kWait;
    step.value = map.number("wait", 0, 1e6);
    ++kinds;
  }
  if (map.has("mark")) {
    step.kind = TourStep::Kind::kMark;
    step.name = map.text("mark");
    ++kinds;
  }
  map.finish();
  if (kinds != 1) map.fail("", "must hold exactly one of drive, turn, face, wait, mark");
  return step;
}

TourScript parse(const YAML::Node& node, const std::string& file) {
  TourScript script;
  script.file = file;
  YamlMap map(node, file, "");
  script.speed_mps = map.number("speed_mps", 0.02, 2, script.speed_mps);
  script.turn_radps = map.number("turn_radps", 0.05, 5, script.turn_radps);
  for (YamlMap& part : map.maps("steps")) script.steps.push_back(read_step(part));
  map.finish();
  if (script.steps.empty()) map.fail("steps", "must name at least one step");
  return script;
}

}  // namespace

TourScript load_tour(const std::string& path) {
  const YAML::Node node = load_yaml_file(path);
  if (node.IsNull()) throw UserError(path + ": is empty; a script needs 'steps'.");
  return parse(node, path);
}

TourScript parse_tour(const std::string& text, const std::string& file_name) {
  try {
    return parse(YAML::Load(text), file_name);
  } catch (const YAML::Exception& error) {
    throw UserError(file_name + ": line " + std::to_string(error.mark.line + 1) + ": " + error.msg + ".");
  }
}

double TourScript::length_m() const {
  double sum = 0.0;
  const Point2* last = nullptr;
  for (const TourStep& step : steps) {
    if (step.kind != TourStep::Kind::kDrive) continue;
    if (last) sum += length(*last, step.path.front());
    sum += length(step.path);
    last = &step.path.back();
  }
  return sum;
}

double TourDriver::progress() const {
  const double whole = script_.length_m();
  return whole > 0.0 ? std::min(1.0, travelled_m_ / whole) : 0.0;
}

void TourDriver::next_step() {
  ++index_;
  started_ = false;
}

TourDriver::Command TourDriver::turn_to(double yaw_rad, const Pose2& robot) {
  Command command;
  const double error = normalize_angle_rad(yaw_rad - robot.yaw_rad);
  // Slows down in time for the base's limits.
  const double speed = std::min(script_.turn_radps, std::sqrt(2.0 * 1.5 * std::abs(error)) + 0.03);
  command.w_radps = std::copysign(speed, error);
  if (std::abs(error) < 0.02) command.w_radps = 0.0;
  return command;
}

TourDriver::Command TourDriver::drive(const TourStep& step, const Pose2& robot, double dt_s) {
  Command command;
  const Point2 here{robot.x_m, robot.y_m};
  const double whole = length(path_);
  along_m_ = std::min(project(path_, here, along_m_), whole);
  const double left_m = std::max(whole - along_m_, length(here, path_.back()));
  if (left_m < kArrived_m || (along_m_ >= whole - 0.01 && length(here, path_.back()) < 0.15)) {
    v_mps_ = 0.0;
    next_step();
    return command;
  }
  const Point2 target = point_along(path_, along_m_ + kLookAhead_m);
  const double reach = std::max(0.1, length(here, target));
  const double error =
      normalize_angle_rad(std::atan2(target.y_m - here.y_m, target.x_m - here.x_m) - robot.yaw_rad);
  if (std::abs(error) > 60.0 * kDegree && (v_mps_ < 0.05 || std::abs(error) > 100.0 * kDegree)) {
    v_mps_ = 0.0;
    return turn_to(robot.yaw_rad + error, robot);
  }
  // Pure pursuit; slower in bends and towards the end, gently, as a person steers.
  const double curvature = 2.0 * std::sin(error) / reach;
  const double wanted = step.speed_mps > 0.0 ? step.speed_mps : script_.speed_mps;
  double v = std::min(wanted, 0.05 + std::sqrt(2.0 * 0.4 * left_m));
  v = std::min(v, script_.turn_radps / std::max(1e-6, std::abs(curvature)));
  v *= std::clamp(std::cos(error), 0.15, 1.0);
  v_mps_ += std::clamp(v - v_mps_, -0.8 * dt_s, 0.5 * dt_s);
  command.v_mps = v_mps_;
  command.w_radps = std::clamp(v_mps_ * curvature, -script_.turn_radps, script_.turn_radps);
  return command;
}

void TourDriver::watch_headway(double now_s, const Pose2& robot, Command* command) {
  const bool moved = distance_m(robot, headway_pose_) > 0.05 ||
                     std::abs(normalize_angle_rad(robot.yaw_rad - headway_pose_.yaw_rad)) > 0.1;
  if (!any_ || moved || (command->v_mps == 0.0 && command->w_radps == 0.0)) {
    headway_pose_ = robot;
    headway_s_ = now_s;
  }
  command->stuck = now_s - headway_s_ > kStuck_s;
}

TourDriver::Command TourDriver::step(double now_s, const Pose2& robot) {
  Command command;
  const double dt_s = any_ ? std::clamp(now_s - last_s_, 0.0, 0.2) : 0.0;
  if (any_) travelled_m_ += distance_m(robot, last_pose_);
  if (index_ >= script_.steps.size()) {
    command.done = true;
    return command;
  }
  const TourStep& step = script_.steps[index_];
  if (!started_) {
    started_ = true;
    marked_ = false;
    step_start_s_ = now_s;
    last_yaw_rad_ = robot.yaw_rad;
    turned_rad_ = along_m_ = 0.0;
    path_.assign(1, Point2{robot.x_m, robot.y_m});
    path_.insert(path_.end(), step.path.begin(), step.path.end());
  }
  const double elapsed_s = now_s - step_start_s_;
  switch (step.kind) {
    case TourStep::Kind::kDrive:
      command = drive(step, robot, dt_s);
      break;
    case TourStep::Kind::kTurn: {
      turned_rad_ += normalize_angle_rad(robot.yaw_rad - last_yaw_rad_);
      last_yaw_rad_ = robot.yaw_rad;
      const double left = step.value - turned_rad_;
      if (std::abs(left) < 0.02) {
        next_step();
      } else {
        command = turn_to(robot.yaw_rad + std::clamp(left, -1.5, 1.5), robot);
      }
      break;
    }
    case TourStep::Kind::kFace:
      command = turn_to(step.value, robot);
      if (std::abs(normalize_angle_rad(step.value - robot.yaw_rad)) < 0.02) next_step();
      break;
    case TourStep::Kind::kWait:
      if (elapsed_s >= step.value) next_step();
      break;
    case TourStep::Kind::kMark:
      // The button is pressed once the robot stands.
      if (!marked_ && elapsed_s >= 0.5) {
        marked_ = true;
        command.mark = step.name;
      } else if (elapsed_s >= 1.0) {
        next_step();
      }
      break;
  }
  watch_headway(now_s, robot, &command);
  last_s_ = now_s;
  last_pose_ = robot;
  any_ = true;
  return command;
}

}  // namespace knav
