#include "kinect_sim/people.h"

#include <algorithm>
#include <cmath>

#include "kinect_sim/collision_map.h"

namespace knav {
namespace {

constexpr double kSocialGap_m =
    0.30;  ///< what a walker keeps between himself and the robot when he has the choice
constexpr double kMinimumGap_m = 0.05;  ///< nobody steps nearer than this
constexpr double kLookAhead_s = 1.0;
constexpr double kArrived_m = 0.25;

double distance(const Pose2& a, const Point2& b) { return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m); }

}  // namespace

People::People(const std::vector<PersonConfig>& configs, const CollisionMap& map)
    : configs_(configs), map_(&map) {
  reset();
}

void People::reset() {
  walks_.assign(configs_.size(), Walk());
  for (std::size_t i = 0; i < walks_.size(); ++i) {
    Walk& walk = walks_[i];
    walk.target = configs_[i].path.size() > 1 ? 1 : 0;
    walk.stand_until_s = configs_[i].start_s + configs_[i].path[0].stand_s;
    if (walk.target == 1) {
      const Point2 &a = configs_[i].path[0].at, &b = configs_[i].path[1].at;
      walk.heading_rad = std::atan2(b.y_m - a.y_m, b.x_m - a.x_m);
    }
  }
}

void People::initial_state(std::vector<PersonState>* state) const {
  state->resize(configs_.size());
  for (std::size_t i = 0; i < configs_.size(); ++i) {
    const Point2& at = configs_[i].path[0].at;
    (*state)[i] = {{at.x_m, at.y_m, walks_[i].heading_rad}, 0.0, configs_[i].radius_m, configs_[i].height_m};
  }
}

void People::step(double t_s, double dt_s, const Pose2& T_world_robot, double robot_v_mps,
                  double robot_radius_m, std::vector<PersonState>* state) {
  for (std::size_t i = 0; i < configs_.size(); ++i) {
    step_one(i, t_s, dt_s, T_world_robot, robot_v_mps, robot_radius_m, state);
  }
}

void People::next_target(std::size_t i, double t_s) {
  Walk& walk = walks_[i];
  const auto& config = configs_[i];
  const auto count = static_cast<int>(config.path.size());
  walk.stand_until_s = t_s + config.path[walk.target].stand_s;
  int next = static_cast<int>(walk.target) + walk.direction;
  if (next < 0 || next >= count) {
    if (config.repeat == PersonConfig::Repeat::kOnce || count < 2) {
      walk.finished = true;
      return;
    }
    if (config.repeat == PersonConfig::Repeat::kLoop) {
      next = (next + count) % count;
    } else {
      walk.direction = -walk.direction;
      next = static_cast<int>(walk.target) + walk.direction;
    }
  }
  walk.target = static_cast<std::size_t>(next);
}

void People::hold_up(std::size_t i, double dt_s, PersonState* me) {
  Walk& walk = walks_[i];
  me->speed_mps = 0.0;
  walk.held_up_s += dt_s;
  if (configs_[i].gives_way_s <= 0.0 || walk.held_up_s < configs_[i].gives_way_s) return;
  walk.held_up_s = 0.0;
  walk.direction = -walk.direction;
  const auto count = static_cast<int>(configs_[i].path.size());
  walk.target = static_cast<std::size_t>((static_cast<int>(walk.target) + walk.direction + count) % count);
}

void People::step_one(std::size_t i, double t_s, double dt_s, const Pose2& robot, double robot_v,
                      double robot_radius, std::vector<PersonState>* state) {
  const PersonConfig& config = configs_[i];
  Walk& walk = walks_[i];
  PersonState& me = (*state)[i];
  if (!walk.finished && config.path.size() > 1 &&
      distance(me.T_world_person, config.path[walk.target].at) < kArrived_m) {
    next_target(i, t_s);
  }
  if (config.path.size() < 2 || walk.finished || t_s < walk.stand_until_s) {
    me.speed_mps = 0.0;
    return;
  }
  const Point2 goal = config.path[walk.target].at;
  const Point2 here{me.T_world_person.x_m, me.T_world_person.y_m};
  const double to_goal = std::atan2(goal.y_m - here.y_m, goal.x_m - here.x_m);
  const double touch = config.radius_m + robot_radius;
  const double now_gap = std::hypot(here.x_m - robot.x_m, here.y_m - robot.y_m) - touch;
  const double gap_wanted = std::min(kSocialGap_m, std::max(now_gap, kMinimumGap_m));

  // Walls are kept off by less than the radius: scripts lead people through doors, and shoulders turn.
  const auto is_clear = [&](double heading, double ahead_s) {
    const Point2 there{here.x_m + config.speed_mps * ahead_s * std::cos(heading),
                       here.y_m + config.speed_mps * ahead_s * std::sin(heading)};
    if (map_->clearance_m(there) < std::min(0.18, config.radius_m)) return false;
    const Point2 robot_then{robot.x_m + robot_v * ahead_s * std::cos(robot.yaw_rad),
                            robot.y_m + robot_v * ahead_s * std::sin(robot.yaw_rad)};
    const double gap = std::hypot(there.x_m - robot_then.x_m, there.y_m - robot_then.y_m) - touch;
    const double gap_to_present = std::hypot(there.x_m - robot.x_m, there.y_m - robot.y_m) - touch;
    if (std::min(gap, gap_to_present) < gap_wanted && gap_to_present < now_gap) return false;
    for (std::size_t j = 0; j < state->size(); ++j) {
      if (j == i) continue;
      const PersonState& other = (*state)[j];
      const double now_m = distance(other.T_world_person, here),
                   then_m = distance(other.T_world_person, there);
      if (then_m < config.radius_m + other.radius_m + 0.05 && then_m < now_m) return false;
    }
    return true;
  };

  const auto passable = [&](double heading) {
    return is_clear(heading, 0.05) && is_clear(heading, 0.4 * kLookAhead_s) &&
           (distance(me.T_world_person, goal) < config.speed_mps * kLookAhead_s ||
            is_clear(heading, kLookAhead_s));
  };
  double chosen = to_goal;
  bool found = passable(to_goal);
  if (found) {
    walk.side = 0.0;
  } else if (config.polite) {
    // Round it, on the side begun with; right hand first.
    const double first = walk.side != 0.0 ? walk.side : -1.0;
    for (int k = 1; k <= 6 && !found; ++k) {
      for (const double side : {first, -first}) {
        const double heading = to_goal + side * k * 20.0 * kPi / 180.0;
        if (passable(heading)) {
          chosen = heading;
          walk.side = side;
          found = true;
          break;
        }
      }
    }
  }
  if (!found) {
    hold_up(i, dt_s, &me);
    return;
  }
  const Point2 next{here.x_m + config.speed_mps * dt_s * std::cos(chosen),
                    here.y_m + config.speed_mps * dt_s * std::sin(chosen)};
  const double next_gap = std::hypot(next.x_m - robot.x_m, next.y_m - robot.y_m) - touch;
  if (next_gap < kMinimumGap_m && next_gap < now_gap) {
    hold_up(i, dt_s, &me);
    return;
  }
  walk.held_up_s = 0.0;
  me.speed_mps = config.speed_mps;
  const double turn = normalize_angle_rad(chosen - me.T_world_person.yaw_rad);
  const double limit = 4.0 * dt_s;
  me.T_world_person = {next.x_m, next.y_m,
                       normalize_angle_rad(me.T_world_person.yaw_rad + std::clamp(turn, -limit, limit))};
}

}  // namespace knav
