#include <gtest/gtest.h>

#include <cmath>

#include "planner_tracker/moving_cells.h"
#include "planner_tracker/path_tracker.h"
#include "planner_tracker/walkers.h"
#include "toy_world.h"

namespace knav {
namespace {

/// A room of 8 x 6 m whose local map is the whole of it, five times a second; the robot stands at (2, 3) and looks along +x.
class WatchedRoom : public ::testing::Test {
 protected:
  WatchedRoom() : map_(0.7, 65, 25, 0.0, 0.0, {0.0, 0.0, 0.24}), grid_(room(8.0, 6.0)) {
    map_.set_global({}, grid_, {});
    cells_.reset(map_.global());
  }
  void see(const OccupancyGrid& local) {
    now_s_ += 0.2;
    map_.set_local(local, {}, now_s_);
    cells_.update(map_.global(), map_.combined(), map_.local_window(), {robot_.x_m, robot_.y_m}, now_s_);
    walkers_.update(cells_.points(), map_.combined(), robot_, now_s_);
  }
  /// The side that somebody at this point turns to the robot.
  OccupancyGrid with_somebody(const Point2& at) const {
    OccupancyGrid local = grid_;
    const GridGeometry& g = local.geometry;
    for (int iy = 0; iy < g.height_cells; ++iy) {
      for (int ix = 0; ix < g.width_cells; ++ix) {
        const double x = g.center_x_m(ix) - at.x_m, y = g.center_y_m(iy) - at.y_m, d = std::hypot(x, y);
        if (d < 0.25 && d > 0.15 && x < 0.0) local.value[g.index(ix, iy)] = 100;
      }
    }
    return local;
  }
  const std::vector<Walker>& expected() {
    walkers_.expected(now_s_, 3.0, &expected_);
    return expected_;
  }

  CombinedMap map_;
  OccupancyGrid grid_;
  MovingCells cells_;
  Walkers walkers_{6.0};
  std::vector<Walker> expected_;
  Pose2 robot_{2.0, 3.0, 0.0};
  double now_s_ = 100.0;
};

TEST_F(WatchedRoom, WhoWalkedIsExpectedWhereHeHasComeToForAsLongAsAskedFor) {
  double y_m = 1.0;
  for (int i = 0; i < 15; ++i) see(with_somebody({4.0, y_m += 0.7 * 0.2}));
  ASSERT_EQ(expected().size(), 1u);
  EXPECT_NEAR(expected()[0].v_mps.y_m, 0.7, 0.1);
  robot_.yaw_rad = -kPi / 2;  // looks away; the local map keeps him where he was
  const OccupancyGrid last = with_somebody({4.0, y_m});
  for (int i = 0; i < 12; ++i) {
    see(last);
    y_m += 0.7 * 0.2;
  }
  ASSERT_EQ(expected().size(), 1u);
  EXPECT_NEAR(expected()[0].at.y_m, y_m, 0.3);
  for (int i = 0; i < 20; ++i) see(last);
  EXPECT_TRUE(expected().empty());
}

TEST_F(WatchedRoom, WhoIsNotWhereHeWasExpectedThoughTheCameraLooksThereIsForgotten) {
  double y_m = 2.0;
  for (int i = 0; i < 10; ++i) see(with_somebody({4.0, y_m += 0.7 * 0.2}));
  ASSERT_EQ(expected().size(), 1u);
  for (int i = 0; i < 4; ++i) see(grid_);
  EXPECT_TRUE(expected().empty());
}

TEST_F(WatchedRoom, FurnitureThatComesIntoViewBitByBitDoesNotWalk) {
  OccupancyGrid local = grid_;
  for (double x_m = 3.0; x_m < 5.0; x_m += 0.15) {
    fill(&local, 3.0, 4.0, x_m, 4.2, 100);  // at 0.75 m/s
    see(local);
    EXPECT_TRUE(expected().empty()) << x_m;
  }
}

TEST_F(WatchedRoom, WhoWalkedOutOfViewMayHaveStoppedOnTheNextBitOfHisWayUntilThatIsSeen) {
  double y_m = 2.0;
  for (int i = 0; i < 8; ++i) see(with_somebody({4.0, y_m += 0.7 * 0.2}));
  ASSERT_EQ(expected().size(), 1u);
  EXPECT_TRUE(walkers_.may_stand_at().empty()) << "he is in view";
  robot_.yaw_rad = -kPi / 2;  // looks away
  const OccupancyGrid last = with_somebody({4.0, y_m});
  see(last);
  see(last);
  const auto& places = walkers_.may_stand_at();
  ASSERT_EQ(places.size(), 3u);
  EXPECT_NEAR(places[0].x_m, 4.0 - 0.2, 0.15) << "the side that he turned to the robot";
  EXPECT_NEAR(places[0].y_m, y_m, 0.15);
  EXPECT_NEAR(places[2].y_m - places[0].y_m, 0.35, 0.08) << "half a second at 0.7 m/s";
  // Laid over the map they close it, but not where the robot is.
  const auto state = [&](const Point2& p) { return map_.combined().at(grid_.geometry.cell_x(p.x_m), grid_.geometry.cell_y(p.y_m)); };
  const Point2 ahead{places[2].x_m, places[2].y_m + 0.15};
  EXPECT_EQ(state(ahead), CellState::kFree);
  map_.set_local(last, {}, now_s_ += 0.2, robot_, places);
  EXPECT_EQ(state(ahead), CellState::kSupposed);
  robot_.yaw_rad = 0.4;  // looks there again: what is there is in the local map
  see(last);
  EXPECT_TRUE(walkers_.may_stand_at().empty());
}

TEST_F(WatchedRoom, WhereThatIsNotWantedNobodyIsSupposedToHaveStopped) {
  walkers_ = Walkers(0.0);
  double y_m = 2.0;
  for (int i = 0; i < 8; ++i) see(with_somebody({4.0, y_m += 0.7 * 0.2}));
  robot_.yaw_rad = -kPi / 2;
  for (int i = 0; i < 3; ++i) see(with_somebody({4.0, y_m}));
  EXPECT_EQ(expected().size(), 1u) << "he is expected to walk on all the same";
  EXPECT_TRUE(walkers_.may_stand_at().empty());
}

class WalkerAtTheSide : public ::testing::Test {
 protected:
  /// At full speed, at (2, 4) along +x, an open room round it.
  double speed(const Walker& walker) {
    const PlannerTrackerConfig config;
    CombinedMap map(0.7, 65, 25);
    const OccupancyGrid grid = room(8.0, 8.0);
    map.set_global({}, grid, {});
    const ScanView view = open_view();
    const std::vector<Walker> walkers{walker};
    TrackInput input;
    input.T_map_base = {2.0, 4.0, 0.0};
    input.v_mps = config.max_vel_x;
    input.layer = &map.combined();
    input.scan = &view;
    input.walkers = &walkers;
    Path path;
    path.set({{2.0, 4.0}, {7.0, 4.0}});
    PathTracker tracker(config);
    for (int i = 0; i < 20; ++i) input.v_mps = tracker.follow(input, path).v_mps;
    return input.v_mps;
  }
};

TEST_F(WalkerAtTheSide, IsLetPassIfTheyWouldMeetAndOnlyThen) {
  const double full = PlannerTrackerConfig{}.max_vel_x;
  // In 1.6 s both are at (2.96, 4): he comes from the left, 59 degrees off the camera's axis.
  EXPECT_EQ(speed({{2.96, 5.6}, {0.0, -1.0}}), 0.0);
  EXPECT_EQ(speed({{2.96, 2.4}, {0.0, 1.0}}), 0.0);
  EXPECT_NEAR(speed({{2.96, 5.6}, {0.0, 1.0}}), full, 0.02) << "walks away";
  EXPECT_NEAR(speed({{1.0, 5.6}, {0.0, -1.0}}), full, 0.02) << "passes behind";
  EXPECT_NEAR(speed({{2.0, 4.6}, {-0.5, 0.0}}), full, 0.02) << "has passed";
  EXPECT_NEAR(speed({{0.9, 4.0}, {1.0, 0.0}}), full, 0.02) << "comes up from behind: standing does not help";
}

}  // namespace
}  // namespace knav
