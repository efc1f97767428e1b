// What amcl's clients rely on, against the running node. The tests are steps of one story and run in order.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <gtest/gtest.h>
#include <kinect_nav/LocalizationStatus.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/SetMap.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Empty.h>
#include <tf2_msgs/TFMessage.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <cmath>
#include <functional>
#include <map>
#include <vector>

#include "ros_common/conversions.h"
#include "synthetic_building.h"

namespace knav {
namespace {

using Status = kinect_nav::LocalizationStatus;

/// The robot, its odometry (which starts 1 m off and turned), its laser and the clock.
class Robot {
 public:
  Robot() : tf(ros::Duration(30.0)), listener(tf) {
    clock_pub = nh.advertise<rosgraph_msgs::Clock>("/clock", 5);
    scan_pub = nh.advertise<sensor_msgs::LaserScan>("scan_360", 5);
    map_pub = nh.advertise<nav_msgs::OccupancyGrid>("map", 1, true);
    pose_pub = nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("initialpose", 1);
    status_sub = nh.subscribe<Status>("localization_status", 100, [this](const Status::ConstPtr& m) {
      status = *m;
      answered[m->header.stamp.toNSec() / 1000000] = true;
    });
    amcl_pose_sub = nh.subscribe<geometry_msgs::PoseWithCovarianceStamped>(
        "amcl_pose", 100, [this](const geometry_msgs::PoseWithCovarianceStamped::ConstPtr& m) {
          amcl_pose = *m;
          ++amcl_poses;
        });
    cloud_sub = nh.subscribe<geometry_msgs::PoseArray>(
        "particlecloud", 10, [this](const geometry_msgs::PoseArray::ConstPtr& m) { cloud = *m; });
    tf_sub = nh.subscribe<tf2_msgs::TFMessage>("/tf", 500, [this](const tf2_msgs::TFMessage::ConstPtr& m) {
      for (const auto& t : m->transforms) {
        if (t.child_frame_id == "odom") map_odom_stamps.push_back(t.header.stamp);
      }
    });
  }

  void spin(double wall_s) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(wall_s);
    while (ros::WallTime::now() < end) {
      ros::spinOnce();
      ros::WallDuration(0.002).sleep();
    }
  }
  bool wait(const std::function<bool()>& done, double wall_s = 5.0) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(wall_s);
    while (!done() && ros::WallTime::now() < end) {
      ros::spinOnce();
      ros::WallDuration(0.001).sleep();
    }
    return done();
  }

  Pose2 T_odom_base() const { return Pose2{1.0, -1.0, 0.7} * truth; }
  sensor_msgs::LaserScan scan_message() const {
    test::ScanModel laser;
    laser.rays = 720;
    laser.noise_m = 0.01;
    sensor_msgs::LaserScan message;
    knav::scan_message(make_scan(building, truth, laser, now_s), &message);
    message.header.stamp = ros::Time(now_s);
    message.header.frame_id = "base_link";
    return message;
  }
  void tick() {
    now_s += 0.1;
    rosgraph_msgs::Clock clock;
    clock.clock = ros::Time(now_s);
    clock_pub.publish(clock);
  }
  void send_odometry() { send_odometry(now_s); }
  void send_odometry(double stamp_s) {
    geometry_msgs::TransformStamped t;
    t.header.stamp = ros::Time(stamp_s);
    t.header.frame_id = "odom";
    t.child_frame_id = "base_link";
    t.transform = transform_message(T_odom_base());
    broadcaster.sendTransform(t);
  }
  /// One scan, and the wait for the status that answers it.
  bool step(const Pose2& T_before_after = Pose2()) {
    truth = truth * T_before_after;
    tick();
    send_odometry();
    scan_pub.publish(scan_message());
    return wait([this] { return answered.count(ros::Time(now_s).toNSec() / 1000000) > 0; });
  }
  bool turn_until(std::uint8_t wanted, int steps) {
    for (int i = 0; i < steps; ++i) {
      if (!step({0.01, 0.0, 0.1})) return false;
      if (status.status == wanted) return true;
    }
    return false;
  }
  void send_pose(const Pose2& pose, const std::string& frame = "map") {
    geometry_msgs::PoseWithCovarianceStamped message;
    message.header.frame_id = frame;
    message.header.stamp = ros::Time(now_s);
    message.pose.pose = pose_message(pose);
    message.pose.covariance[0] = message.pose.covariance[7] = 0.04;
    message.pose.covariance[35] = 0.01;
    pose_pub.publish(message);
    spin(0.3);
  }
  Pose2 cloud_mean() const {
    Pose2 mean;
    for (const auto& p : cloud.poses) {
      mean.x_m += p.position.x / static_cast<double>(cloud.poses.size());
      mean.y_m += p.position.y / static_cast<double>(cloud.poses.size());
    }
    return mean;
  }

  test::Building building = test::office();
  Pose2 truth{10.5, 5.0, 2.0};
  double now_s = 100.0;
  ros::NodeHandle nh;
  tf2_ros::Buffer tf;
  tf2_ros::TransformListener listener;
  tf2_ros::TransformBroadcaster broadcaster;
  ros::Publisher clock_pub, scan_pub, map_pub, pose_pub;
  ros::Subscriber status_sub, amcl_pose_sub, cloud_sub, tf_sub;
  Status status;
  std::map<std::uint64_t, bool> answered;
  geometry_msgs::PoseWithCovarianceStamped amcl_pose;
  int amcl_poses = 0;
  geometry_msgs::PoseArray cloud;
  std::vector<ros::Time> map_odom_stamps;
};

std::unique_ptr<Robot> robot;

nav_msgs::OccupancyGrid occupancy() {
  const DistanceMap map = robot->building.distance_map();
  OccupancyGrid grid;
  grid.geometry = map.geometry;
  for (const float d : map.distance_m) {
    grid.value.push_back(std::isnan(d) ? std::int8_t{-1} : d <= 0.0f ? std::int8_t{100} : std::int8_t{0});
  }
  nav_msgs::OccupancyGrid message;
  occupancy_message(grid, &message);
  message.header.frame_id = "map";
  return message;
}

TEST(AmclClients, A_ScansBeforeTheMapAreAnsweredWithTheReason) {
  ASSERT_TRUE(robot->wait(
      [] { return robot->scan_pub.getNumSubscribers() > 0 && robot->clock_pub.getNumSubscribers() > 0; }));
  robot->tick();
  robot->spin(0.5);
  ASSERT_TRUE(robot->step());
  EXPECT_EQ(robot->status.status, Status::INITIALIZING);
  EXPECT_NE(robot->status.reason.find("no map"), std::string::npos) << robot->status.reason;
  EXPECT_TRUE(robot->map_odom_stamps.empty());
}

TEST(AmclClients, B_APlainMapServersMapIsEnoughToFindThePose) {
  robot->map_pub.publish(occupancy());
  robot->spin(1.0);
  ASSERT_TRUE(robot->turn_until(Status::OK, 120)) << robot->status.reason;
  ASSERT_TRUE(robot->turn_until(Status::OK, 1));
  ASSERT_TRUE(robot->wait([] { return robot->amcl_poses > 0 && !robot->cloud.poses.empty(); }));
  EXPECT_LT(distance_m(pose2_from(robot->amcl_pose.pose.pose), robot->truth), 0.15);
  EXPECT_EQ(robot->amcl_pose.header.frame_id, "map");
  EXPECT_GT(robot->amcl_pose.pose.covariance[0], 0.0);
  EXPECT_GT(robot->amcl_pose.pose.covariance[35], 0.0);
  EXPECT_EQ(robot->cloud.header.frame_id, "map");
  EXPECT_EQ(robot->cloud.poses.size(), robot->status.particles);
  EXPECT_GT(robot->status.inlier_fraction, 0.9);
}

TEST(AmclClients, C_TransformsAtTheNewestStampAreThereAndRight) {
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(robot->step({0.02, 0.0, 0.0}));
  robot->spin(0.3);
  const auto newest = robot->tf.lookupTransform("map", "base_link", ros::Time(0));
  EXPECT_EQ(newest.header.stamp,
            ros::Time(robot->now_s));  // map->odom is post-dated, so odom sets the newest
  EXPECT_LT(distance_m(pose2_from(newest.transform), robot->truth), 0.15);
  const auto now = robot->tf.lookupTransform("map", "odom", ros::Time(robot->now_s));
  EXPECT_LT(distance_m(pose2_from(now.transform) * robot->T_odom_base(), robot->truth), 0.15);
}

TEST(AmclClients, D_BadPosesAreIgnored) {
  const std::size_t particles = robot->cloud.poses.size();
  robot->send_pose({NAN, 1.0, 0.0});
  robot->send_pose({3.0, 3.0, 0.0}, "odom");
  ASSERT_TRUE(robot->turn_until(Status::OK, 3)) << robot->status.reason;
  EXPECT_GT(particles, 0u);
  EXPECT_LT(distance_m(pose2_from(robot->amcl_pose.pose.pose), robot->truth), 0.15);
}

TEST(AmclClients, E_AGivenPoseMovesTheParticlesThere) {
  const Pose2 wrong{3.5, 3.0, 0.0};
  robot->send_pose(wrong);
  ASSERT_TRUE(robot->step());
  ASSERT_TRUE(robot->step({0.05, 0.0, 0.0}));
  ASSERT_TRUE(robot->wait([] { return !robot->cloud.poses.empty(); }));
  EXPECT_NE(robot->status.status, Status::OK);  // the scans disagree
  robot->send_pose(robot->truth);
  ASSERT_TRUE(robot->turn_until(Status::OK, 20)) << robot->status.reason;
  robot->spin(0.1);
  EXPECT_LT(distance_m(robot->cloud_mean(), robot->truth), 0.2);
}

TEST(AmclClients, F_AnUpdateWithoutMotionComesWhenAskedFor) {
  for (int i = 0; i < 15; ++i) ASSERT_TRUE(robot->step());  // any search ends
  robot->spin(0.2);
  const int before = robot->amcl_poses;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(robot->step());
  robot->spin(0.2);
  EXPECT_EQ(robot->amcl_poses, before);
  std_srvs::Empty empty;
  ASSERT_TRUE(ros::service::call("request_nomotion_update", empty));
  ASSERT_TRUE(robot->step());
  robot->spin(0.2);
  EXPECT_EQ(robot->amcl_poses, before + 1);
}

TEST(AmclClients, G_GlobalLocalizationForgetsAndFindsAgain) {
  std_srvs::Empty empty;
  ASSERT_TRUE(ros::service::call("global_localization", empty));
  ASSERT_TRUE(robot->step());
  EXPECT_NE(robot->status.status, Status::OK);
  ASSERT_TRUE(robot->turn_until(Status::OK, 120)) << robot->status.reason;
  ASSERT_TRUE(robot->step({0.05, 0.0, 0.0}));
  EXPECT_LT(distance_m(pose2_from(robot->amcl_pose.pose.pose), robot->truth), 0.2);
}

TEST(AmclClients, H_EmptyScansAndUnknownFramesDoNotHurt) {
  robot->tick();
  robot->send_odometry();
  sensor_msgs::LaserScan scan = robot->scan_message();
  scan.ranges.clear();
  scan.intensities.clear();
  robot->scan_pub.publish(scan);
  robot->spin(0.2);
  EXPECT_NE(robot->status.reason.find("no rays"), std::string::npos) << robot->status.reason;
  for (const char* frame : {"nobody_knows_me", ""}) {
    robot->tick();
    robot->send_odometry();
    scan = robot->scan_message();
    scan.header.frame_id = frame;
    robot->scan_pub.publish(scan);
  }
  for (int i = 0; i < 10; ++i) {
    robot->tick();
    robot->send_odometry();
    robot->scan_pub.publish(robot->scan_message());
    robot->spin(0.02);
  }
  EXPECT_TRUE(robot->turn_until(Status::OK, 20)) << robot->status.reason;
}

TEST(AmclClients, I_AGapInTheTransformsIsSurvived) {
  for (int i = 0; i < 15; ++i) {  // scans whose stamp has no odometry
    robot->tick();
    robot->scan_pub.publish(robot->scan_message());
    robot->spin(0.02);
  }
  EXPECT_TRUE(robot->turn_until(Status::OK, 20)) << robot->status.reason;
  robot->spin(0.2);
  const auto T = robot->tf.lookupTransform("map", "base_link", ros::Time(0));
  EXPECT_LT(distance_m(pose2_from(T.transform), robot->truth), 0.2);
}

TEST(AmclClients, J_NoStampOfMapToOdomIsSentTwice) {
  ASSERT_GT(robot->map_odom_stamps.size(), 20u);
  for (std::size_t i = 1; i < robot->map_odom_stamps.size(); ++i) {
    ASSERT_GT(robot->map_odom_stamps[i], robot->map_odom_stamps[i - 1]) << i;
  }
}

TEST(AmclClients, K_SetMapTakesMapAndPose) {
  nav_msgs::SetMap call;
  call.request.map = occupancy();
  call.request.initial_pose.header.frame_id = "map";
  call.request.initial_pose.pose.pose = pose_message(robot->truth);
  ASSERT_TRUE(ros::service::call("set_map", call));
  EXPECT_TRUE(call.response.success);
  EXPECT_TRUE(robot->turn_until(Status::OK, 40)) << robot->status.reason;
}

TEST(AmclClients, KA_DiagnosticsTellVerdictSpreadAndCorrections) {
  std::map<std::string, std::string> values;
  std::string message;
  const ros::Subscriber sub = robot->nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 10, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& array) {
        for (const auto& status : array->status) {
          message = status.message;
          for (const auto& pair : status.values) values[pair.key] = pair.value;
        }
      });
  for (int i = 0; i < 200 && message.rfind("ok", 0) != 0; ++i) {
    ASSERT_TRUE(robot->step());
    robot->spin(0.02);
  }
  ASSERT_EQ(message.rfind("ok", 0), 0u) << message;
  EXPECT_GT(std::stod(values["position sd m"]), 0.0);
  EXPECT_LT(std::stod(values["position sd m"]), 0.5);
  EXPECT_GT(std::stod(values["heading sd deg"]), 0.0);
  EXPECT_EQ(values.count("corrections, jumps"), 1u);
}

TEST(AmclClients, L_AClockThatJumpsBackStartsAnew) {
  const double before_s = robot->now_s;
  robot->now_s = 20.0;
  robot->answered.clear();
  robot->tick();
  robot->spin(0.3);
  ASSERT_TRUE(robot->step());
  // One of the old time that was still on its way; it comes after all have emptied their buffers.
  robot->send_odometry(before_s);
  robot->spin(0.7);
  robot->tf.clear();  // this test's own, which that one spoilt
  EXPECT_NE(robot->status.status, Status::OK);
  ASSERT_TRUE(robot->turn_until(Status::OK, 120)) << robot->status.reason;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(robot->step({0.05, 0.0, 0.0}));
  robot->spin(0.3);
  const auto T = robot->tf.lookupTransform("map", "base_link", ros::Time(0));
  EXPECT_LT(distance_m(pose2_from(T.transform), robot->truth), 0.2);
  EXPECT_NEAR(T.header.stamp.toSec(), robot->now_s, 0.2);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_localizer_ros");
  knav::robot = std::make_unique<knav::Robot>();
  const int result = RUN_ALL_TESTS();
  knav::robot.reset();
  return result;
}
