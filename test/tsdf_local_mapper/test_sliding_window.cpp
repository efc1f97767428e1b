// When observations, and their far parts before them, leave the map.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "test/core/tsdf_observations.h"
#include "tsdf_local_mapper/sliding_window.h"

namespace knav {
namespace {

/// A wall 3 m ahead in the right half of the view, and one 9 m ahead in the left half; the robot stands, as far as the map goes.
class Window : public ::testing::Test {
 protected:
  static TsdfConfig every_row() {
    TsdfConfig config = fixed_truncation(0.3);
    config.every_row_to_m = 0.0;
    return config;
  }
  Window() : grid_(every_row(), 12.0) {
    config_.distance_m = 40.0;
    config_.far_m = 6.0;
    config_.far_distance_m = 10.0;
    config_.max_observations = 5;
  }
  void push(SlidingWindow* window, double travelled_m, bool scan = false) {
    TsdfObservation& o = window->scratch();
    if (scan) {
      RangeScan ranges;
      ranges.angle_min_rad = -0.4;
      ranges.angle_increment_rad = 0.01;
      ranges.range_max_m = 20.0;
      for (int i = 0; i < 81; ++i) ranges.range_m.push_back(i < 40 ? 3.0f : 9.0f);
      observation_from(ranges, limits_of(fixed_truncation(0.3)), &o);
    } else {
      std::vector<float> z_m(81, 9.0f);  // the first column is the leftmost
      std::fill(z_m.begin() + 41, z_m.end(), 3.0f);
      observation_from(profile_of(z_m, 100.0), limits_of(fixed_truncation(0.3)), &o);
    }
    o.T_map_sensor = {0.0, 0.0, 0.0};
    window->expire(&grid_, travelled_m, travelled_m, false);
    window->push(&grid_, travelled_m, travelled_m, false);
  }
  bool near_wall() const { return grid_.known(grid_.cell_of(3.0), grid_.cell_of(-0.5)); }
  bool far_wall() const { return grid_.known(grid_.cell_of(9.0), grid_.cell_of(1.5)); }

  WindowConfig config_;
  TsdfGrid grid_;
};

TEST_F(Window, AProfilesFarPartLeavesFirstAndTheRestWithItsTime) {
  SlidingWindow window(config_);
  for (const double travelled_m : {0.0, 1.0, 2.0}) push(&window, travelled_m);
  EXPECT_TRUE(near_wall());
  EXPECT_TRUE(far_wall());
  window.expire(&grid_, 11.5, 11.5, false);
  EXPECT_TRUE(far_wall()) << "the third one's";
  window.expire(&grid_, 12.5, 12.5, false);
  EXPECT_FALSE(far_wall());
  EXPECT_TRUE(near_wall());
  EXPECT_EQ(window.size(), 3);
  window.expire(&grid_, 41.5, 41.5, false);
  EXPECT_TRUE(near_wall());
  window.expire(&grid_, 42.5, 42.5, false);
  EXPECT_FALSE(near_wall());
  EXPECT_EQ(window.size(), 0);
}

TEST_F(Window, OneThatMakesRoomTakesWithItWhatIsLeftOfIt) {
  SlidingWindow window(config_);
  for (int i = 0; i < 20; ++i) push(&window, 3.0 * i);  // five are held, the last three with their far parts
  EXPECT_EQ(window.size(), 5);
  EXPECT_TRUE(far_wall());
  window.expire(&grid_, 57.0 + 10.5, 57.0 + 10.5, false);
  EXPECT_FALSE(far_wall());
  EXPECT_TRUE(near_wall());
  window.expire(&grid_, 200.0, 200.0, false);
  for (int ix = grid_.first_x(); ix < grid_.first_x() + grid_.size_cells(); ++ix) {
    for (int iy = grid_.first_y(); iy < grid_.first_y() + grid_.size_cells(); ++iy) ASSERT_EQ(grid_.weight_units(ix, iy), 0);
  }
}

TEST_F(Window, DoubtShortensTheMemoryByAFewDozenFramesAtATime) {
  config_.max_observations = 1000;
  config_.distance_m = 200.0;
  config_.doubtful_distance_m = 1.0;
  SlidingWindow window(config_);
  for (int i = 0; i < 80; ++i) push(&window, 0.125 * i);  // of 9.875 m
  window.expire(&grid_, 9.875, 9.875, false);
  EXPECT_EQ(window.size(), 80);
  window.expire(&grid_, 9.875, 9.875, true);
  EXPECT_EQ(window.size(), 40);
  window.expire(&grid_, 9.875, 9.875, false);
  EXPECT_EQ(window.size(), 40) << "sure again: what is left stays";
  for (int i = 0; i < 3; ++i) window.expire(&grid_, 9.875, 9.875, true);
  EXPECT_EQ(window.size(), 9) << "a metre, both ends included";
}

TEST_F(Window, AScansFarPartStays) {
  SlidingWindow window(config_);
  push(&window, 0.0, true);
  window.expire(&grid_, 20.0, 20.0, false);
  EXPECT_TRUE(far_wall());
}

}  // namespace
}  // namespace knav
