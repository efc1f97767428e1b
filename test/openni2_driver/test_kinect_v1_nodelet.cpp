// A recorded Kinect v1 from libfreenect's fakenect through the plugin, the OpenNI2 runtime and the nodelet to
// the topic.

#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "fakenect_dump.h"
#include "openni2_driver/kinect_v1/disparity.h"

using namespace knav::fakenect;

TEST(KinectV1Nodelet, DepthImageRawIsExactInMillimetres) {
  ros::NodeHandle node;
  std::vector<sensor_msgs::ImageConstPtr> images;
  sensor_msgs::CameraInfoConstPtr info;
  const auto image_subscriber = node.subscribe<sensor_msgs::Image>(
      "camera/depth/image_raw", 100,
      [&](const sensor_msgs::ImageConstPtr& image) { images.push_back(image); });
  const auto info_subscriber = node.subscribe<sensor_msgs::CameraInfo>(
      "camera/depth/camera_info", 100,
      [&](const sensor_msgs::CameraInfoConstPtr& message) { info = message; });
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(25.0);
  while (ros::ok() && ros::WallTime::now() < end && images.size() < 45) {
    ros::spinOnce();
    ros::WallDuration(0.002).sleep();
  }
  ASSERT_GE(images.size(), 45U);

  // The formula, worked out here once more: similar triangles over the nominal zero plane, 7.5 cm, 120 cm,
  // 0.1042 cm.
  std::vector<uint16_t> mm_of_code(2048, 0);
  for (int code = 0; code < 2047; ++code) {
    const double shift_cm = ((code - 800) / 4.0 - 0.375) * 0.1042;
    const double mm = 10.0 * (120.0 + 120.0 * shift_cm / (7.5 - shift_cm));
    if (shift_cm < 7.5 && mm >= 400.0 && mm <= 26000.0)
      mm_of_code[static_cast<std::size_t>(code)] = static_cast<uint16_t>(std::lround(mm));
  }
  int farthest_mm = 0, refused = 0;
  for (const auto& image : images) {
    ASSERT_EQ(image->encoding, "16UC1");
    ASSERT_EQ(image->width, 640U);
    ASSERT_EQ(image->height, 480U);
    std::vector<uint16_t> got(image->data.size() / 2);
    std::memcpy(got.data(), image->data.data(), image->data.size());
    int frame = 0;
    while (frame < kDistinctFrames && mm_of_code[code_at(0, 0, frame)] != got[0]) ++frame;
    ASSERT_LT(frame, kDistinctFrames);
    int wrong = 0;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const uint16_t mm = got[static_cast<std::size_t>(v * kWidth + u)];
        wrong += mm != mm_of_code[code_at(u, v, frame)] ? 1 : 0;
        farthest_mm = std::max<int>(farthest_mm, mm);
        refused += mm == 0 ? 1 : 0;
      }
    }
    EXPECT_EQ(wrong, 0);
  }
  EXPECT_GT(farthest_mm, 20000);
  EXPECT_GT(refused, 0);
  for (std::size_t i = 1; i < images.size(); ++i)
    EXPECT_GT(images[i]->header.stamp, images[i - 1]->header.stamp);
  ASSERT_TRUE(info);
  EXPECT_NEAR(info->K[0], 120.0 / (2 * 0.1042), 0.01);
}

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_kinect_v1_nodelet");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
