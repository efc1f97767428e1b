#pragma once

#include <string>

namespace knav {

/// Which observations the map holds (paper section III.E: 120 s, 20 m). With four times that a robot that comes back within 80 m
/// finds its own map again, and its estimate with it; but one that is carried away holds on to where it was, so that it
/// remembers less while the localizer is in doubt (docs/local_mapper.md).
struct WindowConfig {
  double duration_s = 300.0;
  double distance_m = 80.0;
  double doubtful_distance_m = 8.0;
  double far_m = 6.0;
  double far_distance_m = 20.0;
  std::string clock = "moving";
  int max_observations = 6000;
  int parked_observations = 60;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("duration_s", duration_s, 1, 3600, "s", "An observation leaves the map after this long.");
    v.number("distance_m", distance_m, 1, 200, "m", "An observation leaves after the robot drove this far.");
    v.number("doubtful_distance_m", doubtful_distance_m, 1, 200, "m",
             "The same while the localizer does not know where the robot is (localization_status): it may have been carried, and holds on to where it was "
             "for as long as that is remembered.");
    v.number("far_m", far_m, 0, 100, "m",
             "DepthProfile: what a frame says of places farther from the camera than this leaves sooner, as a depth camera errs with the range squared; 0 = no "
             "sooner than the rest.");
    v.number("far_distance_m", far_distance_m, 1, 200, "m", "Namely after the robot drove this far.");
    v.choice("clock", clock, {"paper", "moving"},
             "What duration_s counts: all time, or only the time the robot moves (a parked robot keeps its "
             "walls).");
    v.integer("max_observations", max_observations, 10, 100000, "frames",
              "The oldest leaves when there are more.");
    v.integer("parked_observations", parked_observations, 1, 100000, "frames",
              "While parked (clock: moving) only this many of the newest frames of that place are held.");
  }
};

}  // namespace knav
