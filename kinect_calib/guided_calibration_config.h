#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "kinect_calib/quadratic_fit.h"

namespace knav {

/// How the robot is taken through the wall's distances. Units as the names say.
struct GuidedCalibrationConfig {
  double first_distance_m = 0.55;
  double last_distance_m = 4.0;
  double step = 0.10;
  int frames = 8;
  int range_readings = 8;
  double square_within_deg = 0.4;
  double speed_mps = 0.1;
  double turn_max_radps = 0.25;
  double turn_min_radps = 0.05;
  int swing_every = 1;
  double swing_deg = 10.0;
  double settle_s = 0.8;
  double square_limit_s = 40.0;
  double depth_stale_s = 0.5;
  double odometry_stale_s = 0.5;
  double range_stale_s = 2.0;
  double calm_s = 2.0;
  double give_up_s = 60.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("first_distance_m", first_distance_m, 0.5, 3, "m",
             "The nearest wall; a Kinect sees nothing nearer than 0.5 m.");
    v.number("last_distance_m", last_distance_m, 0.75, 5, "m", "The farthest.");
    v.number("step", step, 0.05, 0.15, "", "From one distance to the next, as a share of it.");
    v.integer("frames", frames, 1, 200, "", "Depth images kept at each distance.");
    v.integer("range_readings", range_readings, 3, 1000, "",
              "Of the range finder at each distance; their median counts.");
    v.number("square_within_deg", square_within_deg, 0.1, 3, "deg",
             "How far off square the robot may stand.");
    v.number("speed_mps", speed_mps, 0.01, 0.1, "m/s", "It backs off blind: slowly.");
    v.number("turn_max_radps", turn_max_radps, 0.05, 0.5, "rad/s", "The fastest it turns to get square.");
    v.number("turn_min_radps", turn_min_radps, 0.01, 0.3, "rad/s",
             "The slowest turn that the base still obeys.");
    v.integer("swing_every", swing_every, 0, 100, "",
              "At every so many distances it turns to both sides, to learn from the range finder what is "
              "square; 0: never.");
    v.number("swing_deg", swing_deg, 3, 15, "deg", "How far.");
    v.number("settle_s", settle_s, 0.1, 10, "s",
             "Standing still before the wall is judged; the last half of it counts.");
    v.number("square_limit_s", square_limit_s, 5, 600, "s", "To get square in.");
    v.number("depth_stale_s", depth_stale_s, 0.1, 5, "s", "It stops when the newest depth image is older.");
    v.number("odometry_stale_s", odometry_stale_s, 0.05, 5, "s",
             "It stops when the newest odometry is older.");
    v.number("range_stale_s", range_stale_s, 0.2, 60, "s", "Patience with a silent range finder.");
    v.number("calm_s", calm_s, 0.5, 60, "s", "All must be well for so long before it goes on after a stop.");
    v.number("give_up_s", give_up_s, 5, 3600, "s", "It ends when a stop lasts longer.");
  }

  std::vector<std::string> validate() const {
    std::vector<std::string> faults;
    if (last_distance_m < kLeastSpan * first_distance_m)
      faults.emplace_back(
          "'last_distance_m' must be at least 1.5 times 'first_distance_m', or nothing can be fitted.");
    if (turn_min_radps > turn_max_radps) faults.emplace_back("'turn_min_radps' is above 'turn_max_radps'.");
    return faults;
  }

  static constexpr double kLeastStep = 0.05, kMostStep = 0.15;

  /// The distance after this one: even steps from here to the last, each within 5-15 % and as near to `step`
  /// as goes. 0 when no step is left.
  double next_distance_m(double distance_m) const {
    const double left = std::log(last_distance_m / distance_m);
    if (left < std::log(1.0 + kLeastStep)) return 0.0;
    double steps = std::max(1.0, std::round(left / std::log(1.0 + step)));
    if (left / steps > std::log(1.0 + kMostStep)) steps += 1.0;
    if (left / steps < std::log(1.0 + kLeastStep) && steps > 1.0) steps -= 1.0;
    return distance_m * std::exp(left / steps);
  }
  int steps_after(double distance_m) const {
    int steps = 0;
    while ((distance_m = next_distance_m(distance_m)) > 0.0) ++steps;
    return steps;
  }
};

}  // namespace knav
