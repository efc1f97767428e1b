// The nodelet and the plain node on the virtual device: what arrives on the topics.

#include <diagnostic_msgs/DiagnosticArray.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>

#include <cstdio>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>
#include <vector>

#include "openni2_driver/virtual_device/analytic_room.h"

namespace {

bool spin_until(const std::function<bool()>& condition, double timeout_s) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(timeout_s);
  while (ros::ok() && ros::WallTime::now() < end) {
    ros::spinOnce();
    if (condition()) return true;
    ros::WallDuration(0.002).sleep();
  }
  return false;
}

/// Every image of a topic, with its arrival.
struct Listener {
  Listener(ros::NodeHandle& node, const std::string& topic)
      : subscriber(
            node.subscribe<sensor_msgs::Image>(topic, 100, [this](const sensor_msgs::ImageConstPtr& image) {
              images.push_back(image);
              arrivals_s.push_back(ros::Time::now().toSec());
            })) {}
  std::vector<sensor_msgs::ImageConstPtr> images;
  std::vector<double> arrivals_s;
  ros::Subscriber subscriber;
};

int wrong_pixels(const sensor_msgs::Image& image) {
  std::vector<uint16_t> got(image.data.size() / 2), expected(got.size());
  std::memcpy(got.data(), image.data.data(), image.data.size());
  const int frame = knav::room_frame_of_wall(got[240 * 640 + 320]);
  if (frame < 0) return static_cast<int>(got.size());
  knav::AnalyticRoom().render_depth(static_cast<uint64_t>(frame), {640, 480}, expected.data());
  int wrong = 0;
  for (std::size_t i = 0; i < got.size(); ++i) wrong += got[i] != expected[i] ? 1 : 0;
  return wrong;
}

class OpenNI2Camera : public ::testing::Test {
 protected:
  OpenNI2Camera() {
    ros::NodeHandle("~").getParam("control", control_path_);
    control("plugged 1");
    diagnostics_ = node_.subscribe<diagnostic_msgs::DiagnosticArray>(
        "/diagnostics", 20, [this](const diagnostic_msgs::DiagnosticArrayConstPtr& array) {
          for (const auto& status : array->status) {
            if (status.name.find("plain") == std::string::npos) last_[status.name] = status;
          }
        });
  }
  void control(const std::string& text) const {
    const std::string part = control_path_ + ".part";
    std::ofstream(part) << text << "\n";
    std::rename(part.c_str(), control_path_.c_str());
  }
  /// The nodelet's own diagnostics, once their message holds this text.
  bool diagnosed(const std::string& text, int level, double timeout_s) {
    last_.clear();
    return spin_until(
        [&] {
          for (const auto& [name, status] : last_) {
            if (name.find("device") != std::string::npos && status.level == level &&
                status.message.find(text) != std::string::npos) {
              return true;
            }
          }
          return false;
        },
        timeout_s);
  }

  ros::NodeHandle node_;
  std::string control_path_;
  ros::Subscriber diagnostics_;
  std::map<std::string, diagnostic_msgs::DiagnosticStatus> last_;
};

}  // namespace

TEST_F(OpenNI2Camera, IsIdleUntilSomebodyListens) { EXPECT_TRUE(diagnosed("idle", 0, 10.0)); }

TEST_F(OpenNI2Camera, PublishesDepthExactlyAtRate) {
  Listener depth(node_, "camera/depth/image_raw");
  ASSERT_TRUE(spin_until([&] { return depth.images.size() >= 50; }, 10.0));
  const auto& last = *depth.images.back();
  EXPECT_EQ(last.encoding, sensor_msgs::image_encodings::TYPE_16UC1);
  EXPECT_EQ(last.header.frame_id, "camera_depth_optical_frame");
  EXPECT_EQ(last.width, 640U);
  EXPECT_EQ(last.height, 480U);
  EXPECT_EQ(last.step, 1280U);
  EXPECT_EQ(last.is_bigendian, 0);
  for (std::size_t i = 0; i < depth.images.size(); i += 5)
    EXPECT_EQ(wrong_pixels(*depth.images[i]), 0) << "image " << i;
  // 40 intervals of 1/30 s; a machine under load delays frames, and the stamps must not show it.
  const double span_s = (last.header.stamp - depth.images[depth.images.size() - 41]->header.stamp).toSec();
  EXPECT_NEAR(span_s, 40.0 / 30.0, 0.1);
  for (std::size_t i = 1; i < depth.images.size(); ++i) {
    EXPECT_GT(depth.images[i]->header.stamp, depth.images[i - 1]->header.stamp);
    // depth_time_offset is -0.033 s: no frame was taken after it arrived, nor long before.
    const double age_s = depth.arrivals_s[i] - depth.images[i]->header.stamp.toSec();
    EXPECT_GT(age_s, 0.032);
    EXPECT_LT(age_s, 0.5);
  }
}

TEST_F(OpenNI2Camera, CameraInfoHasTheImagesStampAndTheFieldOfViewsFocalLength) {
  std::vector<sensor_msgs::CameraInfoConstPtr> infos;
  Listener depth(node_, "camera/depth/image_raw");
  auto subscriber = node_.subscribe<sensor_msgs::CameraInfo>(
      "camera/depth/camera_info", 100,
      [&](const sensor_msgs::CameraInfoConstPtr& info) { infos.push_back(info); });
  const auto paired = [&] {
    for (const auto& image : depth.images) {
      if (!infos.empty() && image->header.stamp == infos.back()->header.stamp) return true;
    }
    return false;
  };
  ASSERT_TRUE(spin_until(paired, 8.0));
  const auto& info = *infos.back();
  EXPECT_NEAR(info.K[0], 585.0, 0.01);
  EXPECT_NEAR(info.P[5], 585.0, 0.01);
  EXPECT_EQ(info.K[2], 319.5);
  EXPECT_EQ(info.K[5], 239.5);
  EXPECT_EQ(info.header.frame_id, "camera_depth_optical_frame");
}

TEST_F(OpenNI2Camera, PublishesInfrared) {
  Listener ir(node_, "camera/ir/image");
  ASSERT_TRUE(spin_until([&] { return ir.images.size() >= 5; }, 8.0));
  const auto& image = *ir.images.back();
  EXPECT_EQ(image.encoding, sensor_msgs::image_encodings::MONO16);
  uint16_t corner = 0;
  std::memcpy(&corner, image.data.data(), 2);
  EXPECT_TRUE(corner == 200 || corner == 800);
}

TEST_F(OpenNI2Camera, ThePlainNodeDoesTheSame) {
  Listener depth(node_, "plain/camera/depth/image_raw");
  ASSERT_TRUE(spin_until([&] { return depth.images.size() >= 5; }, 8.0));
  EXPECT_EQ(wrong_pixels(*depth.images.back()), 0);
  EXPECT_EQ(depth.images.back()->header.frame_id, "my_depth");
}

TEST_F(OpenNI2Camera, ACalibrationOfTheIrCameraServesBothStreams) {
  sensor_msgs::CameraInfoConstPtr depth, ir;
  const auto depth_subscriber = node_.subscribe<sensor_msgs::CameraInfo>(
      "plain/camera/depth/camera_info", 10,
      [&](const sensor_msgs::CameraInfoConstPtr& info) { depth = info; });
  const auto ir_subscriber = node_.subscribe<sensor_msgs::CameraInfo>(
      "plain/camera/ir/camera_info", 10, [&](const sensor_msgs::CameraInfoConstPtr& info) { ir = info; });
  ASSERT_TRUE(spin_until([&] { return depth && ir; }, 10.0));
  // ir_calibration.yaml, and for depth its principal point moved by the Kinect's (5, 4) px.
  EXPECT_EQ(ir->K[0], 590.0);
  EXPECT_EQ(ir->K[2], 322.5);
  EXPECT_EQ(ir->K[5], 242.5);
  ASSERT_EQ(ir->D.size(), 5U);
  EXPECT_EQ(ir->D[0], -0.1);
  EXPECT_EQ(depth->K[4], 591.0);
  EXPECT_EQ(depth->K[2], 317.5);
  EXPECT_EQ(depth->P[6], 238.5);
  EXPECT_EQ(depth->D, ir->D);
}

TEST_F(OpenNI2Camera, IsReconfiguredWhileItRuns) {
  Listener depth(node_, "camera/depth/image_raw");
  ASSERT_TRUE(spin_until([&] { return depth.images.size() >= 5; }, 8.0));
  const auto reconfigure = [](int width, int height, double offset_s) {
    dynamic_reconfigure::Reconfigure call;
    call.request.config.ints.resize(2);
    call.request.config.ints[0].name = "width_px";
    call.request.config.ints[0].value = width;
    call.request.config.ints[1].name = "height_px";
    call.request.config.ints[1].value = height;
    call.request.config.doubles.resize(1);
    call.request.config.doubles[0].name = "depth_time_offset";
    call.request.config.doubles[0].value = offset_s;
    return ros::service::call("openni2_camera/set_parameters", call);
  };
  ASSERT_TRUE(reconfigure(320, 240, -0.7));
  const auto newest_is = [&](uint32_t width) {
    return !depth.images.empty() && depth.images.back()->width == width;
  };
  ASSERT_TRUE(spin_until([&] { return newest_is(320); }, 5.0));
  EXPECT_GT(depth.arrivals_s.back() - depth.images.back()->header.stamp.toSec(), 0.69);
  // What is changed is seen in the parameters, as dynamic_reconfigure's users expect.
  int width = 0;
  EXPECT_TRUE(ros::param::get("openni2_camera/width_px", width));
  EXPECT_EQ(width, 320);
  ASSERT_TRUE(reconfigure(640, 480, -0.033));
  EXPECT_TRUE(spin_until([&] { return newest_is(640); }, 5.0));
  EXPECT_EQ(wrong_pixels(*depth.images.back()), 0);
}

TEST_F(OpenNI2Camera, IsBackSoonAfterUnpluggingAndSaysSo) {
  Listener depth(node_, "camera/depth/image_raw");
  for (int round = 0; round < 2; ++round) {
    ASSERT_TRUE(spin_until([&] { return depth.images.size() >= 5; }, 8.0));
    control("plugged 0");
    EXPECT_TRUE(diagnosed("unplugged", 2, 4.0)) << "no diagnostic";
    const std::size_t before = depth.images.size();
    control("plugged 1");
    ASSERT_TRUE(spin_until([&] { return depth.images.size() >= before + 3; }, 3.0)) << "not back within 3 s";
    EXPECT_EQ(wrong_pixels(*depth.images.back()), 0);
    depth.images.clear();
  }
  EXPECT_TRUE(diagnosed("streaming", 0, 4.0));
}

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_openni2_camera_nodelet");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
