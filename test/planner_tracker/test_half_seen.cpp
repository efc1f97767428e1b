// Somebody who stepped beside the robot: what of him the camera can have seen, and how near he may be passed.
#include <gtest/gtest.h>

#include "planner_tracker/combined_map.h"
#include "toy_world.h"

namespace knav {
namespace {

/// A room 6 x 4 m with one thing in it that only the local map has.
class Room {
 public:
  Room() : map_(0.7, 65, 25, 0.0, 0.0, {0.1, 1.3, 0.24}), grid_(room(6.0, 4.0)) { map_.set_global({}, grid_, {}); }

  /// Where the robot is, looking along x, and the thing: x0, y0, x1, y1.
  void see(const Pose2& T_map_robot, double x0, double y0, double x1, double y1) {
    OccupancyGrid local = grid_;
    fill(&local, x0, y0, x1, y1, 100);
    map_.set_local(local, {}, now_s_ += 0.1, T_map_robot);
  }
  CellState at(double x_m, double y_m) const {
    const GridGeometry& g = map_.combined().geometry;
    return map_.combined().at(g.cell_x(x_m), g.cell_y(y_m));
  }

 private:
  CombinedMap map_;
  OccupancyGrid grid_;
  double now_s_ = 100.0;
};

// The cells are 5 cm wide; the thing's own are 3.00 to 3.30, 2.00 to 2.30.
constexpr double kX0 = 3.0, kY0 = 2.0, kX1 = 3.3, kY1 = 2.3;

TEST(HalfSeen, WhatCameUpBesideTheRobotIsTenCentimetresWiderAllRound) {
  Room room;
  room.see({2.2, 2.1, 0.0}, kX0, kY0, kX1, kY1);  // 0.8 m ahead, never seen before
  EXPECT_EQ(room.at(2.97, 2.1), CellState::kSupposed);
  EXPECT_EQ(room.at(2.92, 2.1), CellState::kSupposed);
  EXPECT_EQ(room.at(2.87, 2.1), CellState::kFree);
  EXPECT_EQ(room.at(3.15, 2.38), CellState::kSupposed);
  EXPECT_EQ(room.at(3.15, 2.43), CellState::kFree);
  EXPECT_EQ(room.at(2.92, 1.92), CellState::kFree) << "round corners: 0.14 m off";
}

TEST(HalfSeen, WhatWasInViewFromFartherAwayIsAsWideAsItIsSeenAndStaysSoWhenTheRobotComesNear) {
  Room room;
  room.see({1.0, 2.1, 0.0}, kX0, kY0, kX1, kY1);  // 2 m ahead
  EXPECT_EQ(room.at(2.92, 2.1), CellState::kFree);
  room.see({2.2, 2.1, 0.0}, kX0, kY0, kX1, kY1);
  EXPECT_EQ(room.at(2.92, 2.1), CellState::kFree);
  // Past it, its far side comes into view, which is the same thing's.
  room.see({3.2, 1.5, 1.5}, kX0, kY0, kX1 + 0.15, kY1);
  EXPECT_EQ(room.at(3.52, 2.1), CellState::kFree);
}

TEST(HalfSeen, FromFartherAwayButNotInViewNothingWasSeenOfIt) {
  Room room;
  room.see({1.0, 2.1, 1.5}, kX0, kY0, kX1, kY1);  // 2 m away, to the right of the robot
  EXPECT_EQ(room.at(2.92, 2.1), CellState::kSupposed);
  room.see({1.0, 2.1, 0.1}, kX0, kY0, kX1, kY1);  // it has turned to it
  EXPECT_EQ(room.at(2.92, 2.1), CellState::kFree);
}

TEST(HalfSeen, SomebodyWhoWasSeenWholeAndSteppedUpIsHalfSeenThere) {
  Room room;
  room.see({1.0, 2.1, 0.0}, kX0, kY0, kX1, kY1);
  EXPECT_EQ(room.at(2.92, 2.1), CellState::kFree);
  room.see({1.0, 2.1, 0.0}, 1.7, kY0, 2.0, kY1);  // 0.7 m ahead now
  EXPECT_EQ(room.at(1.62, 2.1), CellState::kSupposed);
  // And back where he was, which the camera saw empty meanwhile: in view again from 2 m.
  room.see({2.2, 2.1, 0.0}, kX0, kY0, kX1, kY1);
  EXPECT_EQ(room.at(2.92, 2.1), CellState::kSupposed) << "0.8 m ahead of the robot that drove up meanwhile";
}

TEST(HalfSeen, WhatWasSeenWholeKeepsItsOutlineWhileTheCameraLooksPastItFromNearUntilItIsSeenFromAfarOrGone) {
  // A body 0.5 m wide seen from 1.8 m; from 0.8 m its legs only, 0.3 m wide.
  const double body_y0 = 1.9, body_y1 = 2.4;
  Room room;
  room.see({1.2, 2.15, 0.0}, kX0, body_y0, kX1, body_y1);
  room.see({2.2, 2.15, 0.0}, kX0, 2.0, kX1, kY1);
  EXPECT_EQ(room.at(3.1, 1.92), CellState::kSupposed);
  EXPECT_EQ(room.at(3.1, 2.37), CellState::kSupposed);
  EXPECT_EQ(room.at(3.1, 1.87), CellState::kFree) << "as wide as it was, no wider";
  room.see({3.1, 2.8, -1.57}, kX0, 2.0, kX1, kY1);  // from another side, near
  EXPECT_EQ(room.at(3.1, 2.37), CellState::kSupposed);
  room.see({1.2, 2.15, 0.0}, kX0, 2.0, kX1, kY1);  // from afar it has shrunk: a box was taken away that stood beside it
  EXPECT_EQ(room.at(3.1, 2.37), CellState::kFree);
  room.see({2.2, 2.15, 0.0}, kX0, 2.0, kX1, kY1);
  EXPECT_EQ(room.at(3.1, 2.37), CellState::kFree);
  // Gone altogether, its outline goes as well.
  Room other;
  other.see({1.2, 2.15, 0.0}, kX0, body_y0, kX1, body_y1);
  other.see({2.2, 2.15, 0.0}, 1.0, 1.0, 1.0, 1.0);
  EXPECT_EQ(other.at(3.1, 1.92), CellState::kFree);
  other.see({2.2, 2.15, 0.0}, kX0, 2.0, kX1, kY1);  // and who comes there then is half seen
  EXPECT_EQ(other.at(2.92, 2.15), CellState::kSupposed);
}

TEST(HalfSeen, WallsOfTheMapThatLieAFewCellsOffAndWideThingsAreAsTheyAre) {
  Room room;
  room.see({1.0, 3.2, 1.57}, 0.5, 3.85, 3.0, 3.95);  // beside the room's upper wall
  EXPECT_EQ(room.at(1.0, 3.77), CellState::kFree);
  Room other;
  other.see({2.2, 2.1, 0.0}, kX0, 1.0, kX1, 3.0);  // 2 m wide
  EXPECT_EQ(other.at(2.92, 2.1), CellState::kFree);
}

/// The front of a box, 3.00 to 3.30 wide at y = 2.00 to 2.05, as a camera at its foot sees it, and the ground behind it, 2.05 to 2.60, of which that sees nothing.
OccupancyGrid front_of_a_box() {
  OccupancyGrid local = room(6.0, 4.0);
  fill(&local, kX0, 2.05, kX1, 2.6, -1);
  fill(&local, kX0, 2.0, kX1, 2.05, 100);
  return local;
}

CellState at(const CombinedMap& map, double x_m, double y_m) {
  const GridGeometry& g = map.combined().geometry;
  return map.combined().at(g.cell_x(x_m), g.cell_y(y_m));
}

TEST(HalfSeen, WhatTheMapDoesNotHaveHasABackWhereNobodyLooked) {
  const Pose2 robot{3.15, 0.5, 1.57};
  CombinedMap flat(0.7, 65, 25, 0.0, 0.0, {0.1, 1.3, 0.24, 0.0}), deep(0.7, 65, 25, 0.0, 0.0, {0.1, 1.3, 0.24, 0.3});
  CombinedMap deep_only(0.7, 65, 25, 0.0, 0.0, {0.0, 1.3, 0.24, 0.3});
  for (CombinedMap* map : {&flat, &deep, &deep_only}) {
    map->set_global({}, room(6.0, 4.0), {});
    map->set_local(front_of_a_box(), {}, 100.0, robot);
  }
  EXPECT_EQ(at(flat, 3.15, 2.2), CellState::kFree) << "the global map's word";
  EXPECT_EQ(at(deep, 3.15, 2.2), CellState::kSupposed);
  EXPECT_EQ(at(deep_only, 3.15, 2.2), CellState::kSupposed) << "with half_seen_m off";
  EXPECT_EQ(at(deep, 3.15, 2.32), CellState::kSupposed);
  EXPECT_EQ(at(deep, 3.15, 2.37), CellState::kFree) << "the seventh cell behind the front";
  EXPECT_EQ(at(deep, 3.32, 2.1), CellState::kFree) << "seen beside it";
  EXPECT_EQ(at(deep, 3.15, 1.97), CellState::kFree) << "seen before it";
  // Once somebody has looked behind it, that is what counts.
  OccupancyGrid from_behind = front_of_a_box();
  fill(&from_behind, kX0, 2.1, kX1, 2.6, 0);
  deep.set_local(from_behind, {}, 101.0, robot);
  EXPECT_EQ(at(deep, 3.15, 2.07), CellState::kSupposed);
  EXPECT_EQ(at(deep, 3.15, 2.12), CellState::kFree);
  // And where the robot is nothing else is.
  deep.set_local(front_of_a_box(), {}, 102.0, {3.15, 2.45, 1.57});
  EXPECT_EQ(at(deep, 3.15, 2.32), CellState::kFree);
}

TEST(HalfSeen, AWallOfTheMapHasNoBack) {
  OccupancyGrid walled = room(6.0, 4.0);
  fill(&walled, kX0, 2.0, kX1, 2.05, 100);
  CombinedMap deep(0.7, 65, 25, 0.0, 0.0, {0.1, 1.3, 0.24, 0.3});
  deep.set_global({}, walled, {});
  deep.set_local(front_of_a_box(), {}, 100.0, {3.15, 0.5, 1.57});
  EXPECT_EQ(at(deep, 3.15, 2.2), CellState::kFree);
}

}  // namespace
}  // namespace knav
