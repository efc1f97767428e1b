#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "core/error.h"
#include "core/file_io.h"
#include "core/pose_buffer.h"
#include "core/trajectory.h"

namespace knav {
namespace {

TEST(Trajectory, WrittenAndReadBack) {
  const auto path =
      (std::filesystem::temp_directory_path() / ("knav_" + std::to_string(::getpid()) + ".tum")).string();
  write_trajectory(path, {{1.5, {1, 2, 3}}, {2.5, {-1, 0.5, -2}}});
  const Trajectory read = read_trajectory(path);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_NEAR(read[1].T_map_robot.yaw_rad, -2.0, 1e-8);
  Pose2 T;
  ASSERT_TRUE(interpolate_at(read, 2.0, 1.5, &T));
  EXPECT_NEAR(T.y_m, 1.25, 1e-6);
  EXPECT_FALSE(interpolate_at(read, 2.0, 0.5, &T));
  EXPECT_FALSE(interpolate_at(read, 0.0, 9.0, &T));
  write_text_atomically(path, "1 2 3\n");
  EXPECT_THROW(read_trajectory(path), UserError);
  std::filesystem::remove(path);
}

TEST(PoseBuffer, InterpolatesExtrapolatesAndNamesGaps) {
  PoseBuffer buffer(3);
  Pose2 T;
  EXPECT_EQ(buffer.at(0, 1, 1, &T), PoseBuffer::Lookup::kEmpty);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(buffer.add(i, {2.0 * i, 0, 0}));
  EXPECT_FALSE(buffer.add(4, {}));
  EXPECT_EQ(buffer.at(1.5, 1, 1, &T), PoseBuffer::Lookup::kTooOld);
  EXPECT_EQ(buffer.at(2.5, 1, 1, &T), PoseBuffer::Lookup::kOk);
  EXPECT_NEAR(T.x_m, 5.0, 1e-12);
  EXPECT_EQ(buffer.at(4.25, 1, 0.5, &T), PoseBuffer::Lookup::kOk);
  EXPECT_NEAR(T.x_m, 8.5, 1e-12);
  EXPECT_EQ(buffer.at(4.75, 1, 0.5, &T), PoseBuffer::Lookup::kTooNew);
  EXPECT_EQ(buffer.at(2.5, 0.5, 1, &T), PoseBuffer::Lookup::kGap);
}

}  // namespace
}  // namespace knav
