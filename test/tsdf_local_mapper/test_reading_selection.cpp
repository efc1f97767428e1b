#include "tsdf_local_mapper/reading_selection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/tsdf_grid.h"
#include "test/tsdf_local_mapper/room_world.h"

namespace knav {
namespace {

/// 3 m ahead, a metre wide, and a wall 2 m behind it.
RoomWorld something_before_a_wall() {
  RoomWorld world;
  world.walls.push_back({3.0, -0.5, 3.0, 0.5});
  world.walls.push_back({5.0, -6.0, 5.0, 6.0});
  return world;
}

DepthProfile seen(int rows_of_the_near_one) {
  DepthProfile profile = something_before_a_wall().profile({}, 1.0);
  for (const float z : profile.z_m) profile.rows.push_back(static_cast<std::uint8_t>(z < 4.0f ? rows_of_the_near_one : 200));
  return profile;
}

/// What is selected of it in a grid that knows nothing.
WeightedPoints selected(const DepthProfile& profile, const FilterConfig& config) {
  TsdfObservation observation;
  observation_from(profile, ObservationLimits{}, &observation);
  ReadingSelection selection(config, MotionModelConfig{});
  return selection.select(observation, {}, TsdfGrid(TsdfConfig{}, 12.0), 1, {}, {}, 0.033);
}

/// Extent across of the near thing's readings that have a say; 0: none has.
double width_with_a_say_m(const WeightedPoints& points) {
  double low = 0.0, high = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points.x_m[i] > 4.0f || points.weight[i] == 0.0f) continue;
    low = std::min(low, static_cast<double>(points.y_m[i]));
    high = std::max(high, static_cast<double>(points.y_m[i]));
  }
  return high - low;
}

FilterConfig all_columns() {
  FilterConfig config;
  config.readings = 640;
  return config;
}

TEST(ReadingSelection, WhatFewRowsShowHasNoSay) {
  const int thin = all_columns().thin_rows;
  EXPECT_EQ(width_with_a_say_m(selected(seen(thin - 1), all_columns())), 0.0);
  EXPECT_GT(width_with_a_say_m(selected(seen(thin), all_columns())), 0.9);
  const WeightedPoints points = selected(seen(thin - 1), all_columns());
  const auto say = std::count_if(points.weight.begin(), points.weight.end(), [](float w) { return w > 0.0f; });
  EXPECT_GT(say, 400) << "the wall behind it has";
}

TEST(ReadingSelection, WhereRowsWereNotCountedAllHaveASay) {
  DepthProfile profile = seen(1);
  profile.rows.clear();
  EXPECT_GT(width_with_a_say_m(selected(profile, all_columns())), 0.9);
  FilterConfig config = all_columns();
  config.thin_rows = 0;
  EXPECT_GT(width_with_a_say_m(selected(seen(1), config)), 0.9);
}

TEST(ReadingSelection, AScanHasNoRows) {
  TsdfObservation observation;
  observation_from(seen(1), ObservationLimits{}, &observation);
  observation_from(something_before_a_wall().scan({}, 2.0, 1.0, 300), ObservationLimits{}, &observation);
  ReadingSelection selection(all_columns(), MotionModelConfig{});
  const WeightedPoints& points = selection.select(observation, {}, TsdfGrid(TsdfConfig{}, 12.0), 1, {}, {}, 0.033);
  EXPECT_EQ(points.size(), 300u);
  for (const float weight : points.weight) ASSERT_EQ(weight, 1.0f);
}

}  // namespace
}  // namespace knav
