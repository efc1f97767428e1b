#pragma once

#include <gtest/gtest.h>

#include <memory>

#include "core/pose2.h"
#include "test/tsdf_local_mapper/room_world.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {

inline constexpr double kFrame_s = 1.0 / 30.0;
inline const Pose2 kT_base_camera{0.05, 0.0, 0.0};

/// The mapper, a room and a robot in it with bad odometry.
class LocalMapperTest : public ::testing::Test {
 protected:
  explicit LocalMapperTest() { config_.filter.particles = 400; }

  void start() { mapper_ = std::make_unique<LocalMapper>(config_); }

  /// One frame: odometry at the stamp, then the profile.
  const LocalMapperResult& frame() {
    stamp_s_ += kFrame_s;
    mapper_->add_odometry(stamp_s_, robot_.T_odom_base);
    return mapper_->update(world_.profile(robot_.T_world_base * kT_base_camera, stamp_s_), kT_base_camera);
  }
  const LocalMapperResult& drive(int frames, double distance_per_frame_m, double turn_per_frame_rad) {
    const LocalMapperResult* result = nullptr;
    for (int i = 0; i < frames; ++i) {
      robot_.drive(distance_per_frame_m, turn_per_frame_rad);
      result = &frame();
    }
    return *result;
  }
  /// A round through the room, about 12 m and one full turn and a half.
  void tour() {
    drive(15, 0.0, 0.0);
    drive(60, 0.025, 0.0);
    drive(45, 0.01, 2.0 / 45);
    drive(60, 0.025, 0.01);
    drive(45, 0.01, 2.0 / 45);
    drive(90, 0.025, 0.012);
    drive(30, 0.02, 0.03);
  }
  /// A square hall with the robot about in its middle.
  static RoomWorld hall(double wall_m) {
    RoomWorld world;
    world.box(-wall_m, -wall_m - 1.0, wall_m + 2.0, wall_m - 1.0);
    return world;
  }
  /// Somebody half a metre wide, `away_m` from the robot.
  void put_somebody(const Pose2& T_world_facing, double away_m, double aside_m) {
    const Pose2 right = T_world_facing * Pose2{away_m, aside_m - 0.25, 0.0}, left = T_world_facing * Pose2{away_m, aside_m + 0.25, 0.0};
    world_.walls.push_back({right.x_m, right.y_m, left.x_m, left.y_m, HeightClass::kMiddle});
  }
  Pose2 error() const {  // local map and world both start at the robot's first pose
    return robot_.T_world_base.inverse() * mapper_->result().T_local_base;
  }
  Pose2 odometry_error() const {
    const Pose2 T_start{3.0, -1.0, 0.4};
    return robot_.T_world_base.inverse() * (T_start.inverse() * robot_.T_odom_base);
  }

  LocalMapperConfig config_;
  std::unique_ptr<LocalMapper> mapper_;
  RoomWorld world_ = RoomWorld::furnished();
  DrivenRobot robot_;
  double stamp_s_ = 100.0;
};

}  // namespace knav
