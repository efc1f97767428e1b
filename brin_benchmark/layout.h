#pragma once

#include <map>
#include <string>
#include <vector>

#include "brin_benchmark/floor_plan.h"
#include "kinect_sim/world.h"

namespace knav {

struct LayoutConfig {
  int seed = 1;
  int runs = 12;
  int places = 8;             ///< where the world has none
  double sequence_m = 250.0;  ///< of every run, at least
  double robot_radius_m = 0.20;
  double tour_spacing_m = 4.0;  ///< the tour comes this near to every place that can be reached
  double moved_share = 0.3;     ///< of the movable furniture
  int people = 0;               ///< in every run; 0 = 3 to 6, and 10 in a crowd
  std::string closed_door;      ///< closed in every run, whatever it cuts off
  std::vector<Point2> keep_free;  ///< nothing is put on these, whether they can be reached or not
};

/// A benchmark laid out in a building: where the robot is sent, how it is mapped, and what changes from run
/// to run. Every place stays reachable, for a robot with 7 cm to spare on each side, whatever stands in the
/// way for good.
struct Layout {
  std::map<std::string, Pose2> places;
  std::vector<std::string> sequence;
  std::string tour;     ///< a tour script
  std::string changes;  ///< a changes file; its `tour` names `tour_name`
};

/// The same world and configuration give the same bytes. UserError if the building leaves no room.
Layout lay_out(const WorldConfig& world, const LayoutConfig& config, const std::string& tour_name);

/// `world`, with a start inside the building if its own is not (in a world without places: their owner knows where they are).
/// UserError if nothing is closed off by walls.
WorldConfig started_inside(const WorldConfig& world, double robot_radius_m);
/// Places far from each other and from the start, with room around them.
std::map<std::string, Pose2> choose_places(const FloorPlan& plan, const WorldConfig& world, int count);
/// Through all places and near every point that can be reached, with a look round at each stop; back to the
/// start.
std::string make_tour(const FloorPlan& plan, const WorldConfig& world,
                      const std::map<std::string, Pose2>& places, double spacing_m);
/// One run's changes, as an entry of the list `runs`.
std::string make_run(const FloorPlan& plan, const WorldConfig& world,
                     const std::map<std::string, Pose2>& places, const std::vector<std::vector<Point2>>& legs,
                     const LayoutConfig& config, int run);

}  // namespace knav
