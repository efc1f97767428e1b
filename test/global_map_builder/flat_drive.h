#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "flat_world.h"
#include "global_map_builder/map_builder.h"

namespace knav::flat_world {

inline constexpr double kStart_s = 100.0;
inline constexpr double kPeriod_s = 0.1;
inline const Pose2 kMount{0.05, 0.0, 0.0};

struct Route {
  std::vector<Wall> walls = ring();
  std::vector<Pose2> truth, odometry;
};

inline Route once_round_and_a_bit() {
  Route drive;
  drive.truth = drive_through({{0, 0}, {11, 0}, {11, 7}, {0, 7}, {0, 0}, {6, 0}});
  drive.odometry = drifting_odometry(drive.truth);
  return drive;
}

inline void feed(const Route& drive, const std::vector<std::size_t>& marks, MapBuilder* builder,
                 double start_s = kStart_s) {
  for (std::size_t i = 0; i < drive.truth.size(); ++i) {
    const double stamp_s = start_s + static_cast<double>(i) * kPeriod_s;
    builder->add_odometry(stamp_s, drive.odometry[i]);
    if (std::count(marks.begin(), marks.end(), i) > 0) builder->mark(stamp_s);
    RandomStream random(7, random_stream::kTest, i, 0);
    builder->add(profile_at(drive.walls, drive.truth[i] * kMount, stamp_s, random), kMount);
  }
}

inline LocalMapperConfig small_mapper() {
  LocalMapperConfig config;
  config.filter.particles = 300;
  config.grid_half_size_m = 14.0;
  config.range_max_m = config.contour.range_max_m = 10.0;
  return config;
}

}  // namespace knav::flat_world
