#pragma once

#include <Eigen/Core>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "core/grid_geometry.h"
#include "core/pose2.h"
#include "kinect_sim/solid.h"

namespace knav {

/// A door leaf that turns about its hinge. Closed it reaches from hinge to `closed_end`.
struct DoorConfig {
  struct Change {
    double at_s = 0.0;
    double open_rad = 0.0;
  };
  std::string name;
  Point2 hinge, closed_end;
  double thickness_m = 0.04, height_m = 2.05;
  double open_rad = 0.0;         ///< at the start; counter-clockwise from closed
  std::vector<Change> schedule;  ///< sorted by time
};

/// A person who walks from waypoint to waypoint.
struct PersonConfig {
  struct Waypoint {
    Point2 at;
    double stand_s = 0.0;  ///< how long to stand there
  };
  enum class Repeat { kLoop, kBackAndForth, kOnce };
  std::string name;
  std::vector<Waypoint> path;  ///< one waypoint: stands there
  Repeat repeat = Repeat::kBackAndForth;
  double speed_mps = 1.0, start_s = 0.0, radius_m = 0.25, height_m = 1.75;
  bool polite = true;  ///< walks round the robot; if not, just stops before it
  double gives_way_s = 0.0;  ///< who has stood before something for so long walks back the way he came; 0: never
};

/// An axis-aligned rectangle of the floor.
struct FloorRect {
  double min_x_m = 0.0, min_y_m = 0.0, max_x_m = 0.0, max_y_m = 0.0;
  bool contains(double x_m, double y_m) const {
    return x_m > min_x_m && x_m < max_x_m && y_m > min_y_m && y_m < max_y_m;
  }
};

/// A piece that is there for part of the time only: a box put in the way, a chair moved.
struct TimedSolid {
  Solid solid;
  double appears_s = 0.0, disappears_s = std::numeric_limits<double>::infinity();
};

/// Furniture that can be moved or taken away: the solids [first, first + count) of the world.
struct WorldPiece {
  Point2 at;
  std::size_t first = 0, count = 0;
};

/// A flat piece of paper: seen, but nothing to run into. Convex, counter-clockwise as seen from its front; nothing
/// behind. Frame: world [m].
struct Panel {
  std::vector<Eigen::Vector3d> corners;
  Material material = Material::kPaper;
};

/// A building as config/worlds/*.yaml describes it (docs/simulator.md has the keys), broken into prisms.
struct WorldConfig {
  std::string file;
  std::string name;
  double ceiling_m = 2.6;     ///< 0: no ceiling
  std::vector<Solid> solids;  ///< always there; glass included
  std::vector<TimedSolid> timed_solids;
  std::vector<WorldPiece> pieces;  ///< boxes, tables, chairs and cylinders that are always there
  std::vector<Panel> panels;  ///< chessboards and markers
  std::vector<DoorConfig> doors;
  std::vector<PersonConfig> people;
  std::vector<FloorRect> stairs;  ///< holes in the floor
  std::vector<FloorRect> sun_patches;
  std::map<std::string, Pose2> places;
  Pose2 spawn;
  FloorRect bounds;  ///< of everything, with a margin
};

/// Whether nothing may stand where the robot starts.
enum class StartMustBe { kFree, kAnywhere };

/// UserError, one sentence with file and key, for anything unknown, malformed or contradictory.
WorldConfig load_world(const std::string& path, StartMustBe start = StartMustBe::kFree);
/// The same from a text; `directory` resolves the files it names.
WorldConfig parse_world(const std::string& text, const std::string& file_name,
                        const std::string& directory = ".");

/// Walls from an occupancy image: each occupied run of cells becomes a prism `height_m` high.
/// @param grid value > 50 is occupied; its origin gives the place in the world
std::vector<Solid> extrude_occupancy(const OccupancyGrid& grid, double height_m);

/// The leaf of a door at an opening angle.
Solid door_leaf(const DoorConfig& door, double open_rad);

/// Its opening angle at a time, by its schedule.
double door_open_at(const DoorConfig& door, double t_s);

/// The pieces that a robot or a person of this height touches, doors and timed pieces at time t included.
std::vector<Solid> solids_at(const WorldConfig& world, double t_s);

}  // namespace knav
