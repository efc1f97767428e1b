#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/pose2.h"
#include "core/random.h"
#include "kinect_calib/calibration_view.h"
#include "kinect_calib/terminal_prompt.h"
#include "kinect_calib/wall_viewer.h"

namespace knav {
namespace {

using ::testing::HasSubstr;

const PinholeModel kCamera = {640, 480, 585.0, 585.0, 319.5, 239.5};
constexpr double kDegree = kPi / 180.0;

/// A wall seen by a camera that looks left of its normal by yaw and up by pitch, in codes with noise, with
/// the device's ring.
cv::Mat wall(double distance_m, double yaw_deg, double pitch_deg = 0.0) {
  cv::Mat depth(480, 640, CV_32FC1);
  for (int v = 0; v < 480; ++v) {
    RandomStream random(5, random_stream::kTest, 9, static_cast<std::uint32_t>(v));
    for (int u = 0; u < 640; ++u) {
      const double x = (u - kCamera.cx_px) / kCamera.fx_px, y = (v - kCamera.cy_px) / kCamera.fy_px;
      const double ring_per_m = 0.01 * std::cos(7.0 * std::hypot(x, y));
      const double q =
          (1.0 + std::tan(yaw_deg * kDegree) * x + std::tan(pitch_deg * kDegree) * y) / distance_m +
          ring_per_m + 0.55 * kInverseDepthPerCode * random.normal();
      const double code = std::round(q / kInverseDepthPerCode);
      depth.at<float>(v, u) = static_cast<float>(1.0 / (code * kInverseDepthPerCode));
    }
  }
  return depth;
}

/// @param seen_to_m farther off it gives nothing
void add_floor(double camera_height_m, double seen_to_m, cv::Mat* depth) {
  for (int v = 241; v < 480; ++v) {
    const double floor_m = camera_height_m * 585.0 / (v - 239.5);
    for (int u = 0; u < 640; ++u) {
      if (floor_m > depth->at<float>(v, u)) continue;
      depth->at<float>(v, u) =
          floor_m < seen_to_m ? static_cast<float>(floor_m) : std::numeric_limits<float>::quiet_NaN();
    }
  }
}

TEST(WallViewer, TellsDistanceAndAngles) {
  WallViewer viewer(kCamera);
  for (const double distance_m : {0.55, 1.0, 2.0, 4.0}) {
    for (const double yaw_deg : {-18.0, -8.0, 0.0, 0.5, 8.0, 18.0}) {
      cv::Mat depth = wall(distance_m, yaw_deg, 2.0);
      add_floor(0.5, 10.0, &depth);
      const SeenWall& view = viewer.look(depth);
      EXPECT_EQ(view.fault, "") << distance_m << " m, " << yaw_deg << " deg";
      // The ring is symmetric about the middle, so it bends no angle; of the distance it takes its share.
      EXPECT_NEAR(view.plane.yaw_rad() / kDegree, yaw_deg, 0.1 + 0.02 * std::abs(yaw_deg)) << distance_m;
      EXPECT_NEAR(view.plane.distance_m(), distance_m, 0.01 * distance_m * distance_m) << yaw_deg;
      if (distance_m < 0.8) {
        EXPECT_NEAR(view.plane.pitch_rad() / kDegree, 2.0, 1.2) << distance_m;
      }
    }
  }
}

TEST(WallViewer, FloorThatDropsOutBeforeTheWallIsNoPerson) {
  WallViewer viewer(kCamera);
  for (double seen_to_m = 2.0; seen_to_m < 4.0; seen_to_m += 0.1) {
    cv::Mat depth = wall(3.95, 0.0);
    add_floor(0.5, seen_to_m, &depth);
    EXPECT_EQ(viewer.look(depth).fault, "") << seen_to_m;
  }
}

TEST(WallViewer, SomebodyBeforeTheWallMakesItNoPlane) {
  WallViewer viewer(kCamera);
  for (const double distance_m : {1.0, 2.5, 4.0}) {
    cv::Mat depth = wall(distance_m, 0.0);
    add_floor(0.5, 10.0, &depth);
    depth(cv::Rect(400, 100, 60, 300)).setTo(static_cast<float>(0.75 * distance_m));
    EXPECT_THAT(viewer.look(depth).fault, HasSubstr("no plane")) << distance_m;
  }
  cv::Mat corner = wall(2.0, 0.0);  // a wall that ends: behind its end is another
  corner.colRange(400, 640).setTo(4.0f);
  EXPECT_THAT(viewer.look(corner).fault, HasSubstr("no plane"));
}

TEST(WallViewer, SaysWhatToDo) {
  WallViewer viewer(kCamera);
  EXPECT_THAT(viewer.look(wall(1.0, 24.0)).fault, HasSubstr("turn the robot"));
  EXPECT_THAT(viewer.look(wall(0.6, 0.0, 8.0)).fault, HasSubstr("up; level it"));
  const cv::Mat nothing(480, 640, CV_32FC1, cv::Scalar(std::numeric_limits<float>::quiet_NaN()));
  EXPECT_THAT(viewer.look(nothing).fault, HasSubstr("0.5 m"));
}

TEST(CalibrationView, DrawsTheCrossWhereToldAndTheTextBelow) {
  const cv::Mat infrared(480, 640, CV_16UC1, cv::Scalar(300));
  const cv::Mat view = infrared_view(infrared, 324.5, 243.5, {"one line", "another"});
  EXPECT_EQ(view.type(), CV_8UC3);
  EXPECT_EQ(view.cols, 640);
  EXPECT_GT(view.rows, 480);
  const cv::Vec3b arm = view.at<cv::Vec3b>(243, 350), middle = view.at<cv::Vec3b>(243, 324);
  EXPECT_GT(arm[1], arm[0]);
  EXPECT_EQ(middle[1], middle[0]) << "the marker must be seen";

  WallViewer viewer(kCamera);
  const cv::Mat depth = wall(2.0, 0.0);
  const WallPlane plane = viewer.look(depth).plane;
  const cv::Mat deviation = deviation_view(depth, kCamera, plane, {});
  // The ring: nearer than the plane in the middle, farther where the cosine has turned.
  const cv::Scalar middle_mean = cv::mean(deviation(cv::Rect(290, 150, 60, 40)));
  EXPECT_GT(middle_mean[2], middle_mean[0]);
  const cv::Scalar outer_mean = cv::mean(deviation(cv::Rect(40, 220, 40, 40)));
  EXPECT_GT(outer_mean[0], outer_mean[2]);
}

TEST(TerminalPrompt, ReadsMetresAsPeopleWriteThem) {
  EXPECT_DOUBLE_EQ(parse_distance_m("0.815").value(), 0.815);
  EXPECT_DOUBLE_EQ(parse_distance_m(" 1,2 m\r").value(), 1.2);
  for (const char* line : {"", "m", "82 cm", "-1", "0", "nan", "1000"})
    EXPECT_FALSE(parse_distance_m(line)) << line;
}

}  // namespace
}  // namespace knav
