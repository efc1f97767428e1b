// rostest: in lock-step the simulator waits for the answer to each frame.
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/LaserScan.h>

#include <chrono>
#include <thread>
#include <vector>

namespace {

TEST(SimulatorLockstep, NoFrameIsSkippedHoweverSlowTheAnswers) {
  ros::NodeHandle handle;
  ros::Publisher answer = handle.advertise<sensor_msgs::LaserScan>("answer", 10);
  std::vector<double> stamps;
  const auto subscriber =
      handle.subscribe<sensor_msgs::Image>("camera/depth/image_raw", 10, [&](const sensor_msgs::Image::ConstPtr& m) {
        stamps.push_back(m->header.stamp.toSec());
        if (stamps.size() % 5 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(150));  // five frames' time
        sensor_msgs::LaserScan scan;
        scan.header.stamp = m->header.stamp;
        answer.publish(scan);
      });
  const auto start = std::chrono::steady_clock::now();
  while (ros::ok() && stamps.size() < 40 && std::chrono::steady_clock::now() - start < std::chrono::seconds(60)) {
    ros::spinOnce();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ASSERT_GE(stamps.size(), 40u);
  // The first answers may be lost while connections are made; from then on every frame follows the last.
  for (std::size_t i = 11; i < stamps.size(); ++i) EXPECT_NEAR(stamps[i] - stamps[i - 1], 1.0 / 30.0, 1e-3) << i;
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_simulator_lockstep");
  return RUN_ALL_TESTS();
}
