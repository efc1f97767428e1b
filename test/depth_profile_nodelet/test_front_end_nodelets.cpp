#include <gtest/gtest.h>
#include <kinect_nav/DepthProfile.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "analytic_scene.h"
#include "kinect_calib/depth_messages.h"

namespace knav {
namespace {

/// The camera and the base of a robot that stands before a wall, and ears for what the four nodelets make of
/// it.
class FrontEndNodelets : public testing::Test {
 protected:
  FrontEndNodelets() {
    image_publisher_ = node_.advertise<sensor_msgs::Image>("camera/depth/image_raw", 4);
    info_publisher_ = node_.advertise<sensor_msgs::CameraInfo>("camera/depth/camera_info", 4);
    odometry_publisher_ = node_.advertise<nav_msgs::Odometry>("odom", 50);
    geometry_msgs::TransformStamped mount;
    mount.header.stamp = ros::Time::now();
    mount.header.frame_id = "base_link";
    mount.child_frame_id = "camera_depth_optical_frame";
    mount.transform.translation.x = 0.05;
    mount.transform.translation.z = 0.5;
    mount.transform.rotation.x = -0.5;
    mount.transform.rotation.y = 0.5;
    mount.transform.rotation.z = -0.5;
    mount.transform.rotation.w = 0.5;
    transforms_.sendTransform(mount);
    test::Scene scene;
    scene.floor();
    scene.wall(4.0);
    view_ = test::to_millimetres(test::render(scene, test::kinect_camera(), test::mount()));
  }

  void listen() {
    profile_subscriber_ = node_.subscribe<kinect_nav::DepthProfile>(
        "depth_profile", 8, [this](const kinect_nav::DepthProfileConstPtr& m) { profiles_.push_back(m); });
    scan_subscriber_ = node_.subscribe<sensor_msgs::LaserScan>(
        "scan", 8, [this](const sensor_msgs::LaserScanConstPtr& m) { scans_.push_back(m); });
  }

  bool wait_for(const std::function<bool()>& reached, double timeout_s,
                const std::function<void()>& each = {}) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(timeout_s);
    while (ros::WallTime::now() < end) {
      if (each) each();
      ros::WallDuration(0.03).sleep();
      ros::spinOnce();
      if (reached()) return true;
    }
    return false;
  }

  void publish(const sensor_msgs::Image& image) {
    nav_msgs::Odometry odometry;
    odometry.header.stamp = image.header.stamp;
    odometry.pose.pose.orientation.w = 1.0;
    odometry_publisher_.publish(odometry);
    sensor_msgs::CameraInfo info;
    rectified_info(sensor_msgs::CameraInfo(), test::kinect_camera(), &info);
    info.header = image.header;
    info.width = 640;
    info.height = 480;
    info_publisher_.publish(info);
    image_publisher_.publish(image);
  }

  sensor_msgs::Image good_image(bool metres) {
    sensor_msgs::Image image;
    image.header.stamp = ros::Time::now();
    image.header.frame_id = "camera_depth_optical_frame";
    if (metres) {
      cv::Mat out = make_depth_message(image.header, 640, 480, &image);
      for (int v = 0; v < 480; ++v) {
        for (int u = 0; u < 640; ++u) {
          const std::uint16_t mm = view_.at<std::uint16_t>(v, u);
          out.at<float>(v, u) =
              mm == 0 ? std::numeric_limits<float>::quiet_NaN() : 0.001f * static_cast<float>(mm);
        }
      }
      return image;
    }
    image.width = 640;
    image.height = 480;
    image.encoding = "16UC1";
    image.step = 1280;
    image.data.assign(view_.data, view_.data + view_.total() * 2);
    return image;
  }

  void expect_wall(const kinect_nav::DepthProfile& profile) {
    EXPECT_EQ(profile.header.frame_id, "camera_depth_optical_frame");
    EXPECT_FLOAT_EQ(profile.fx, 585.0f);
    EXPECT_NEAR(profile.camera_height_m, 0.5, 0.01);
    ASSERT_EQ(profile.z.size(), 640u);
    ASSERT_EQ(profile.height_class.size(), 640u);
    for (std::size_t u = 0; u < 640; ++u) {
      ASSERT_NEAR(profile.z[u], 4.0f, 0.03f) << u;
      ASSERT_NEAR(profile.free_from[u], 1.22f, 0.05f) << u;
      ASSERT_NEAR(profile.free_to[u], profile.z[u], 0.05f) << u;
      ASSERT_EQ(profile.height_class[u], kinect_nav::DepthProfile::HEIGHT_MIDDLE) << u;
    }
  }

  ros::NodeHandle node_;
  ros::Publisher image_publisher_, info_publisher_, odometry_publisher_;
  ros::Subscriber profile_subscriber_, scan_subscriber_;
  tf2_ros::StaticTransformBroadcaster transforms_;
  cv::Mat view_;
  std::vector<kinect_nav::DepthProfileConstPtr> profiles_;
  std::vector<sensor_msgs::LaserScanConstPtr> scans_;
};

TEST_F(FrontEndNodelets, WorkOnlyWhileSomebodyListensAndPassBothEncodings) {
  wait_for([] { return false; }, 2.0);
  EXPECT_EQ(image_publisher_.getNumSubscribers(), 0u) << "nobody listens yet";
  listen();
  ASSERT_TRUE(wait_for([&] { return image_publisher_.getNumSubscribers() > 0; }, 20.0));
  for (const bool metres : {false, true}) {
    profiles_.clear();
    scans_.clear();
    ros::Time stamp;
    ASSERT_TRUE(wait_for([&] { return !profiles_.empty() && !scans_.empty(); }, 20.0,
                         [&] { publish(good_image(metres)); }))
        << metres;
    expect_wall(*profiles_.back());
    EXPECT_EQ(scans_.back()->header.frame_id, "camera_link");
    EXPECT_NEAR(scans_.back()->ranges[scans_.back()->ranges.size() / 2], 4.0, 0.03);
  }
  profile_subscriber_.shutdown();
  scan_subscriber_.shutdown();
  EXPECT_TRUE(wait_for([&] { return image_publisher_.getNumSubscribers() == 0; }, 10.0))
      << "nobody listens any more";
}

TEST_F(FrontEndNodelets, BrokenImagesGiveNothingAndDoNoHarm) {
  listen();
  ASSERT_TRUE(wait_for([&] { return !profiles_.empty(); }, 20.0, [&] { publish(good_image(false)); }));
  wait_for([] { return false; }, 0.5);
  profiles_.clear();
  const auto broken = [&](const std::function<void(sensor_msgs::Image&)>& breaking) {
    sensor_msgs::Image image = good_image(false);
    breaking(image);
    publish(image);
    wait_for([] { return false; }, 0.1);
  };
  broken([](sensor_msgs::Image& image) { image.data.resize(100); });
  broken([](sensor_msgs::Image& image) { image.width = image.height = 1; });
  broken([](sensor_msgs::Image& image) { image.width = image.height = image.step = 0; });
  broken([](sensor_msgs::Image& image) { image.encoding = "rgb8"; });
  broken([](sensor_msgs::Image& image) { image.step = 3; });
  broken([](sensor_msgs::Image& image) { image.height = 4000000000u; });
  broken([](sensor_msgs::Image& image) { image.header.frame_id = "nowhere"; });
  EXPECT_TRUE(profiles_.empty());
  broken([](sensor_msgs::Image& image) { image.data.assign(image.data.size(), 0); });
  ASSERT_TRUE(wait_for([&] { return !profiles_.empty(); }, 5.0))
      << "an all-zero frame is a frame: all unknown";
  for (std::size_t u = 0; u < 640; ++u) {
    ASSERT_TRUE(std::isnan(profiles_.back()->z[u]));
    ASSERT_TRUE(std::isnan(profiles_.back()->free_to[u]));
  }
  profiles_.clear();
  ASSERT_TRUE(wait_for([&] { return !profiles_.empty(); }, 10.0, [&] { publish(good_image(false)); }));
  expect_wall(*profiles_.back());
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_front_end_nodelets");
  const ros::NodeHandle keeps_ros_running;
  return RUN_ALL_TESTS();
}
