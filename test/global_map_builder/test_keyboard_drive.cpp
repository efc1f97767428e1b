#include <gtest/gtest.h>

#include "global_map_builder/growing_map.h"
#include "global_map_builder/keyboard_drive.h"

namespace knav {
namespace {

KeyboardDrive::Speeds run(KeyboardDrive* drive, double from_s, double to_s) {
  KeyboardDrive::Speeds speeds;
  for (double t = from_s; t < to_s; t += 0.05) speeds = drive->update(t, "");
  return speeds;
}

TEST(KeyboardDrive, AHeldArrowAcceleratesWithinLimitsAndStopsWhenReleased) {
  KeyboardDrive drive({});
  drive.update(0.0, "");
  const KeyboardDrive::Speeds first = drive.update(0.05, "\x1b[A");
  EXPECT_NEAR(first.forward_mps, 0.8 * 0.05, 1e-9) << "no jump to full speed";
  const KeyboardDrive::Speeds held = run(&drive, 0.1, 0.6);
  EXPECT_NEAR(held.forward_mps, 0.4, 1e-9);
  EXPECT_EQ(held.turn_radps, 0.0);
  EXPECT_EQ(run(&drive, 0.65, 1.5).forward_mps, 0.0) << "nobody holds a key any more";
}

TEST(KeyboardDrive, KeysThatComeInPartsAndTogether) {
  KeyboardDrive drive({});
  drive.update(0.0, "\x1b");
  drive.update(0.05, "[");
  EXPECT_LT(drive.update(0.1, "C").turn_radps, 0.0) << "right is clockwise";
  const KeyboardDrive::Speeds both = drive.update(0.15, "wa");
  EXPECT_GT(both.forward_mps, 0.0);
  EXPECT_EQ(run(&drive, 0.2, 0.5).turn_radps, 0.5);
  const KeyboardDrive::Speeds stopped = drive.update(0.5, " ");
  EXPECT_EQ(stopped.forward_mps, 0.0);
  EXPECT_EQ(stopped.turn_radps, 0.0);
}

TEST(KeyboardDrive, MarksAreCountedOnceAndQEndsAtRest) {
  KeyboardDrive drive({});
  drive.update(0.0, "mm");
  EXPECT_EQ(drive.take_marks(), 2);
  EXPECT_EQ(drive.take_marks(), 0);
  drive.update(0.05, "w");
  EXPECT_FALSE(drive.ended());
  EXPECT_EQ(drive.update(0.1, "q").forward_mps, 0.0);
  EXPECT_TRUE(drive.ended());
}

/// A scan all round from the middle of a square room of 4 m.
DriveFrame frame_at(double x_m, double stamp_s) {
  RangeScan scan;
  scan.stamp_s = stamp_s;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = kPi / 360.0;
  scan.range_min_m = 0.1;
  scan.range_max_m = 10.0;
  for (int i = 0; i < 720; ++i) {
    const double a = scan.angle_min_rad + i * scan.angle_increment_rad, c = std::cos(a), s = std::sin(a);
    const double to_x = c > 0 ? (2.0 - 0.0) / c : 2.0 / -c, to_y = 2.0 / std::max(std::fabs(s), 1e-9);
    scan.range_m.push_back(static_cast<float>(std::min(to_x, to_y)));
  }
  return {stamp_s, 0.0, {x_m, 0.0, 0.0}, {}, {}, scan};
}

TEST(GrowingMap, TakesInNewFramesAndGrows) {
  SurfaceConfig surface;
  surface.min_looks = 1;
  GrowingMap map(surface, 0.1);
  EXPECT_TRUE(map.grid().value.empty());
  Drive drive;
  drive.frames.push_back(frame_at(0.0, 1.0));
  map.update(drive);
  const auto at = [&](double x, double y) {
    const OccupancyGrid grid = map.grid();
    const int ix = grid.geometry.cell_x(x), iy = grid.geometry.cell_y(y);
    return grid.geometry.contains(ix, iy) ? grid.value[grid.geometry.index(ix, iy)] : -2;
  };
  EXPECT_EQ(at(1.0, 0.0), 0);
  EXPECT_EQ(at(2.05, 0.05), 100);
  EXPECT_EQ(at(2.5, 0.05), -1);
  // A second room, beyond the first grid's margin.
  drive.frames.push_back(frame_at(30.0, 2.0));
  map.update(drive);
  EXPECT_EQ(at(31.0, 0.0), 0);
  EXPECT_EQ(at(1.0, 0.0), 0) << "what was there stays";
  EXPECT_EQ(at(15.0, 0.0), -1);
}

}  // namespace
}  // namespace knav
