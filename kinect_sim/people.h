#pragma once

#include <vector>

#include "core/pose2.h"
#include "kinect_sim/world.h"

namespace knav {

class CollisionMap;

struct PersonState {
  Pose2 T_world_person;
  double speed_mps = 0.0;
  double radius_m = 0.25, height_m = 1.75;
};

/// All that moves, at one moment.
struct DynamicState {
  std::vector<PersonState> people;
  std::vector<double> door_open_rad;
  std::vector<char> timed_solid_present;
};

/// Walkers who follow their scripts, keep off walls and each other, and stop for the robot or walk round it;
/// they never walk into it by themselves.
class People {
 public:
  People(const std::vector<PersonConfig>& configs, const CollisionMap& map);

  void reset();
  /// @param t_s time since the start, @param robot its pose and speed, @param state the people are updated
  void step(double t_s, double dt_s, const Pose2& T_world_robot, double robot_v_mps, double robot_radius_m,
            std::vector<PersonState>* state);
  void initial_state(std::vector<PersonState>* state) const;

 private:
  struct Walk {
    std::size_t target = 0;
    int direction = 1;
    double stand_until_s = 0.0;
    double heading_rad = 0.0;
    double side = 0.0;  ///< the side last chosen to pass the robot, +1 left
    double held_up_s = 0.0;
    bool finished = false;
  };
  void step_one(std::size_t i, double t_s, double dt_s, const Pose2& robot, double robot_v,
                double robot_radius, std::vector<PersonState>* state);
  void next_target(std::size_t i, double t_s);
  /// Stands before something for another dt_s.
  void hold_up(std::size_t i, double dt_s, PersonState* me);

  std::vector<PersonConfig> configs_;
  std::vector<Walk> walks_;
  const CollisionMap* map_;
};

}  // namespace knav
