// What the benchmark's figures rest on: the truth map, the search for places that look alike, and the recordings.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "localizer_benchmark/image_world.h"
#include "localizer_benchmark/measures.h"
#include "brin_benchmark/truth_map.h"
#include "localizer_benchmark/unique_places.h"

namespace knav {
namespace {

/// A room of 6 x 4 m inside walls of 0.2 m, with a box in it, as text.
constexpr char kRoom[] =
    "name: room\nspawn: [1, 1, 0]\nwalls:\n"
    "  - {points: [[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]], thickness_m: 0.2}\n"
    "boxes:\n  - {at: [4, 3], size: [1, 0.6, 0.8]}\n";

std::string temporary(const std::string& name) {
  const auto folder = std::filesystem::path(::testing::TempDir()) / "test_localizer_benchmark";
  std::filesystem::create_directories(folder);
  return (folder / name).string();
}

TEST(TruthMap, HoldsTrueDistancesAndKnowsOnlyWhatCanBeReached) {
  const DistanceMap map = truth_map(parse_world(kRoom, "room"));
  const double cell = 0.71 * map.geometry.resolution_m;
  EXPECT_NEAR(map.nearest(1.0, 1.0), 0.9, cell);
  EXPECT_NEAR(map.nearest(3.0, 2.0), 0.5 * std::hypot(1.0, 1.4), 0.3) << "the box's corner";
  EXPECT_NEAR(map.nearest(3.2, 3.0), 0.3, cell);
  EXPECT_LT(map.nearest(3.7, 3.0), 0.0f);
  EXPECT_LT(map.nearest(0.0, 2.0), 0.0f);
  EXPECT_TRUE(std::isnan(map.nearest(-0.7, 2.0))) << "outside";
}

/// What a scanner all round would see.
std::vector<Point2> view_of(const DistanceMap& map, const Pose2& T) {
  std::vector<Point2> view;
  for (double angle = -kPi; angle < kPi; angle += 0.03) {
    double range = 0.1;
    for (; range < 8.0; range += 0.01) {
      const Point2 p = T * Point2{range * std::cos(angle), range * std::sin(angle)};
      if (!(map.nearest(p.x_m, p.y_m) > 0.0f)) break;
    }
    view.push_back({range * std::cos(angle), range * std::sin(angle)});
  }
  return view;
}

TEST(UniquePlaces, ABareRoomLooksTheSameTurnedRoundAndOneWithABoxDoesNot) {
  const Pose2 T{3.6, 1.6, 0.4};  // the box fills a fifth of the view
  Pose2 other;
  const DistanceMap room = truth_map(parse_world(kRoom, "room"));
  EXPECT_GT(UniquePlaces(room).fit(view_of(room, T), T), 0.99);
  EXPECT_TRUE(UniquePlaces(room).unique(view_of(room, T), T, &other));
  std::string text = kRoom;
  text.resize(text.find("boxes:"));
  const DistanceMap bare = truth_map(parse_world(text, "bare"));
  ASSERT_FALSE(UniquePlaces(bare).unique(view_of(bare, T), T, &other));
  EXPECT_NEAR(other.x_m, 6.0 - T.x_m, 0.2);
  EXPECT_NEAR(other.y_m, 4.0 - T.y_m, 0.2);
}

TEST(ImageWorld, IsClosedAndStartsInTheLargestRoom) {
  cv::Mat grey(200, 300, CV_8U, cv::Scalar(206));                                  // unknown
  cv::rectangle(grey, cv::Rect(20, 20, 150, 120), cv::Scalar(255), cv::FILLED);   // a room without drawn walls
  cv::rectangle(grey, cv::Rect(200, 20, 40, 40), cv::Scalar(255), cv::FILLED);    // a smaller one
  cv::line(grey, {170, 80}, {299, 80}, cv::Scalar(255));                           // a streak to the rim
  const std::string image = temporary("plan.png"), file = temporary("plan.yaml");
  ASSERT_TRUE(cv::imwrite(image, grey));
  write_image_world(image, 0.1, file, 1);
  const WorldConfig world = load_world(file);
  EXPECT_NEAR(world.spawn.x_m, 9.5, 1.0);
  EXPECT_NEAR(world.spawn.y_m, 12.0, 1.0);
  EXPECT_FALSE(world.pieces.empty());
  const DistanceMap map = truth_map(world);
  EXPECT_TRUE(std::isnan(map.nearest(22.0, 16.0))) << "the other room cannot be reached";
  EXPECT_FALSE(map.nearest(25.0, 12.0) > 0.0f) << "the streak is no way out";
  EXPECT_THROW(write_image_world(temporary("none.png"), 0.1, file, 1), UserError);
}

TEST(ScanRecording, ComesBackFromItsFile) {
  ScanRecording recording;
  RangeScan scan;
  scan.angle_min_rad = -1.0;
  scan.angle_increment_rad = 0.5;
  scan.range_max_m = 20.0;
  scan.range_m = {1.2345f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN(), 19.5f};
  scan.evidence = {1.0f, 0.5f, 0.0f, 0.25f};
  recording.begins.push_back(0);
  recording.add({7.5, {1, 2, 3}, {4, 5, 0.6}, {7, 8, 0.9}, 3}, scan);
  recording.save(temporary("a.scans"));
  const ScanRecording back = ScanRecording::load(temporary("a.scans"));
  RangeScan again;
  back.scan(0, &again);
  EXPECT_EQ(back.frames[0].epoch, 3u);
  EXPECT_EQ(back.frames[0].T_world_base.y_m, 8.0);
  EXPECT_EQ(again.stamp_s, 7.5);
  EXPECT_NEAR(again.range_m[0], 1.2345, 0.0003);
  EXPECT_TRUE(std::isinf(again.range_m[1]));
  EXPECT_TRUE(std::isnan(again.range_m[2]));
  EXPECT_NEAR(again.evidence[3], 0.25, 0.002);
  std::filesystem::resize_file(temporary("a.scans"), 100);
  EXPECT_THROW(ScanRecording::load(temporary("a.scans")), UserError);
}

TEST(Honesty, CountsOnlyOkAndFarOff) {
  Honesty h;
  Moment m;
  m.dt_s = 1.0;
  m.verdict = LocalizationVerdict::kOk;
  m.error_m = 0.4;
  h.add(m);
  m.error_m = 0.6;
  h.add(m);
  m.verdict = LocalizationVerdict::kUncertain;
  h.add(m);
  EXPECT_EQ(h.ok_s, 2.0);
  EXPECT_EQ(h.ok_wrong_s, 1.0);
  EXPECT_EQ(h.uncertain_s, 1.0);
}

}  // namespace
}  // namespace knav
