#include <gtest/gtest.h>
#include <kinect_nav/DepthProfile.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/Joy.h>
#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Empty.h>
#include <tf2_msgs/TFMessage.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "core/file_io.h"
#include "depth_profile_nodelet/front_end.h"
#include "global_map_builder/observation_reader.h"
#include "ros_common/conversions.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

const FrontEndConfig& front_end() {
  static const FrontEndConfig config;
  return config;
}

nav_msgs::Odometry odometry_at(double stamp_s, double x_m) {
  nav_msgs::Odometry message;
  message.header.stamp = ros::Time(stamp_s);
  message.header.frame_id = "odom";
  message.child_frame_id = "base_link";
  message.pose.pose = pose_message({x_m, 0.0, 0.0});
  return message;
}

sensor_msgs::LaserScan scan_at(double stamp_s) {
  sensor_msgs::LaserScan message;
  message.header.stamp = ros::Time(stamp_s);
  message.header.frame_id = "laser";
  message.angle_min = -0.5f;
  message.angle_increment = 0.5f;
  message.range_min = 0.1f;
  message.range_max = 10.0f;
  message.ranges = {1.0f, 2.0f, 3.0f, 4.0f};
  return message;
}

tf2_msgs::TFMessage mount(double x_m, double z_m, double qx, double qw) {
  geometry_msgs::TransformStamped transform;
  transform.header.frame_id = "/base_link";
  transform.child_frame_id = "laser";
  transform.transform.translation.x = x_m;
  transform.transform.translation.z = z_m;
  transform.transform.rotation.x = qx;
  transform.transform.rotation.w = qw;
  tf2_msgs::TFMessage message;
  message.transforms.push_back(transform);
  return message;
}

class Recording : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / "knav_recordings";
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name = "drive.bag") const { return (folder_ / name).string(); }

  void write(const std::function<void(rosbag::Bag&)>& fill) const {
    rosbag::Bag bag(path(), rosbag::bagmode::Write);
    fill(bag);
    bag.close();
  }
  /// Two seconds: odometry at 10 Hz, a scan at 5 Hz whose message is written 0.3 s late.
  static void fill_drive(rosbag::Bag& bag) {
    for (int i = 0; i <= 20; ++i) {
      const double t = 10.0 + 0.1 * i;
      bag.write("/odom", ros::Time(t), odometry_at(t, 0.05 * i));
      if (i % 2 == 0) bag.write("/scan", ros::Time(t + 0.3), scan_at(t + 0.03));
    }
  }
  std::string fault_of_reading() const {
    try {
      ObservationReader reader(path(), {}, front_end());
      reader.read({});
    } catch (const UserError& error) {
      return error.what();
    }
    return "";
  }
  /// Runs build_map on a file; gives its standard error, checks exit code 1, one line and that nothing was
  /// written.
  std::string refusal_of_build_map(const std::string& bag, const std::string& more = "") const {
    const std::string command =
        std::string(BUILD_MAP) + " " + bag + " --out " + path("map") + " " + more + " 2> " + path("err");
    const int status = std::system(command.c_str());
    EXPECT_EQ(WEXITSTATUS(status), 1) << command;
    EXPECT_FALSE(fs::exists(path("map"))) << "nothing half-written";
    for (const auto& entry : fs::directory_iterator(folder_)) {
      EXPECT_EQ(entry.path().filename().string().find(".part"), std::string::npos) << entry.path();
    }
    std::string text = read_text_file(path("err"));
    EXPECT_NE(text.find("build_map: error: "), std::string::npos) << text;
    return text;
  }

  fs::path folder_;
};

TEST_F(Recording, ComesInTheOrderOfStampsWithOdometryAhead) {
  write([](rosbag::Bag& bag) {
    fill_drive(bag);
    bag.write("/mark_place", ros::Time(11.05), std_msgs::Empty());
    bag.write("/tf_static", ros::Time(10.0), mount(0.1, 0.3, 0.0, 1.0));
  });
  ObservationReader reader(path(), {}, front_end());
  EXPECT_EQ(reader.source(), "scan");
  std::vector<double> scans, marks;
  double newest_odometry = 0.0;
  ObservationCallbacks callbacks;
  callbacks.add_odometry = [&](double stamp_s, const Pose2&) {
    EXPECT_GT(stamp_s, newest_odometry);
    newest_odometry = stamp_s;
  };
  callbacks.scan = [&](const RangeScan& scan, const Pose2& T_base_sensor) {
    EXPECT_NEAR(T_base_sensor.x_m, 0.1, 1e-12);
    if (scan.stamp_s < 11.85) {
      EXPECT_GE(newest_odometry, scan.stamp_s + 0.06) << "to interpolate";
    }
    EXPECT_LT(newest_odometry, scan.stamp_s + 0.2) << "not the whole drive at once";
    if (!marks.empty()) {
      EXPECT_GE(scan.stamp_s, 11.05);
    }
    scans.push_back(scan.stamp_s);
  };
  callbacks.mark = [&](double stamp_s) { marks.push_back(stamp_s); };
  reader.read(callbacks);
  EXPECT_EQ(scans.size(), 11u);
  EXPECT_TRUE(std::is_sorted(scans.begin(), scans.end()));
  EXPECT_EQ(marks.size(), 1u);
  EXPECT_EQ(reader.statistics().odometry, 21u);
  EXPECT_TRUE(reader.warnings().empty());
}

TEST_F(Recording, AHeldJoyButtonIsOneMark) {
  write([](rosbag::Bag& bag) {
    fill_drive(bag);
    for (int i = 0; i < 20; ++i) {
      sensor_msgs::Joy joy;
      joy.header.stamp = ros::Time(10.0 + 0.1 * i);
      joy.buttons = {i >= 4 && i < 9 ? 1 : 0, 1};
      bag.write("/joy", joy.header.stamp, joy);
    }
  });
  ObservationReader reader(path(), {}, front_end());
  std::vector<double> marks;
  ObservationCallbacks callbacks;
  callbacks.mark = [&](double stamp_s) { marks.push_back(stamp_s); };
  reader.read(callbacks);
  ASSERT_EQ(marks.size(), 1u);
  EXPECT_NEAR(marks[0], 10.4, 1e-6);
}

TEST_F(Recording, AMissingMountIsToldAndAnUpsideDownScannerIsTurned) {
  write(fill_drive);
  {
    ObservationReader reader(path(), {}, front_end());
    ASSERT_EQ(reader.warnings().size(), 1u);
    EXPECT_NE(reader.warnings()[0].find("no transform from 'base_link' to the sensor's frame 'laser'"),
              std::string::npos);
  }
  write([](rosbag::Bag& bag) {
    fill_drive(bag);
    bag.write("/tf_static", ros::Time(10.0), mount(0.0, 0.3, 1.0, 0.0));  // rolled by 180 deg
  });
  ObservationReader reader(path(), {}, front_end());
  ObservationCallbacks callbacks;
  callbacks.scan = [&](const RangeScan& scan, const Pose2&) {
    EXPECT_FLOAT_EQ(scan.range_m.front(), 4.0f);  // what was at +1 rad is at -1 rad
    EXPECT_NEAR(scan.angle_min_rad, -1.0, 1e-6);
  };
  reader.read(callbacks);
}

TEST_F(Recording, FaultsNameTheFileAndTheTopic) {
  EXPECT_NE(fault_of_reading().find("no such file"), std::string::npos);
  std::ofstream(path()).close();
  EXPECT_NE(fault_of_reading().find("empty"), std::string::npos);
  std::ofstream(path()) << "this is not a bag at all, though it is long enough to be looked at";
  EXPECT_NE(fault_of_reading().find("not a readable bag"), std::string::npos);

  write([](rosbag::Bag& bag) { bag.write("/scan", ros::Time(10.0), scan_at(10.0)); });
  EXPECT_NE(fault_of_reading().find("'odom' is missing"), std::string::npos);
  write([](rosbag::Bag& bag) { bag.write("/odom", ros::Time(10.0), odometry_at(10.0, 0.0)); });
  EXPECT_NE(fault_of_reading().find("holds no observations"), std::string::npos);
  write([](rosbag::Bag& bag) {
    fill_drive(bag);
    bag.write("/odom", ros::Time(13.0), odometry_at(5.0, 0.0));
  });
  EXPECT_NE(fault_of_reading().find("jumps back by 7.0 s"), std::string::npos);
  write([](rosbag::Bag& bag) {
    bag.write("/scan", ros::Time(10.0), odometry_at(10.0, 0.0));
    bag.write("/odom", ros::Time(10.0), odometry_at(10.0, 0.0));
  });
  EXPECT_NE(fault_of_reading().find("'scan'"), std::string::npos);
}

TEST_F(Recording, BuildMapRefusesInOneSentenceAndWritesNothing) {
  std::ofstream(path("empty.bag")).close();
  EXPECT_NE(refusal_of_build_map(path("empty.bag")).find("empty.bag"), std::string::npos);
  EXPECT_NE(refusal_of_build_map(path("none.bag")).find("none.bag"), std::string::npos);
  write([](rosbag::Bag& bag) { bag.write("/scan", ros::Time(10.0), scan_at(10.0)); });
  EXPECT_NE(refusal_of_build_map(path()).find("odom"), std::string::npos);
  write(fill_drive);
  EXPECT_NE(refusal_of_build_map(path(), "--from profile").find("depth_profile"), std::string::npos);
  EXPECT_NE(refusal_of_build_map(path(), "--config " + path("none.yaml")).find("none.yaml"),
            std::string::npos);
  std::ofstream(path("bad.yaml")) << "map_builder: {surface: {resolutoin_m: 0.1}}\n";
  EXPECT_NE(refusal_of_build_map(path(), "--config " + path("bad.yaml")).find("resolutoin_m"),
            std::string::npos);

  // Cut off: the index at its end is gone.
  write(fill_drive);
  fs::resize_file(path(), fs::file_size(path()) / 2);
  EXPECT_NE(refusal_of_build_map(path()).find("reindex"), std::string::npos);
}

/// A drive of 1.5 m along the middle of a room [-3, 5] x [-low_y_m, 3] in the odometry's frame, which is the room's.
void fill_room(rosbag::Bag& bag, double start_s, double start_x_m, double low_y_m) {
  for (int i = 0; i <= 30; ++i) {
    const double t = start_s + 0.1 * i, x_m = start_x_m + 0.05 * i;
    bag.write("/odom", ros::Time(t), odometry_at(t, x_m));
    sensor_msgs::LaserScan scan = scan_at(t - 0.02);
    scan.angle_min = static_cast<float>(-kPi);
    scan.angle_increment = static_cast<float>(kPi / 180.0);
    scan.range_max = 20.0f;
    scan.ranges.clear();
    for (int ray = 0; ray < 360; ++ray) {
      const double angle = -kPi + ray * kPi / 180.0, c = std::cos(angle), s = std::sin(angle);
      const double to_x = c > 0.0 ? (5.0 - x_m) / c : (-3.0 - x_m) / std::min(c, -1e-9);
      const double to_y = s > 0.0 ? 3.0 / s : -low_y_m / std::min(s, -1e-9);
      scan.ranges.push_back(static_cast<float>(std::min(to_x, to_y)));
    }
    if (i > 0) bag.write("/scan", ros::Time(t), scan);
  }
}

TEST_F(Recording, BuildMapPutsTheBagsOfOneDriveTogether) {
  write([](rosbag::Bag& bag) { fill_room(bag, 10.0, 0.0, 2.0); });
  fs::rename(path(), path("first.bag"));
  write([](rosbag::Bag& bag) { fill_room(bag, 13.2, 1.5, 2.0); });
  const std::string command = std::string(BUILD_MAP) + " " + path("first.bag") + " " + path() + " --out " + path("map") + " --json " +
                              path("figures.json") + " 2> " + path("err");
  ASSERT_EQ(WEXITSTATUS(std::system(command.c_str())), 0) << read_text_file(path("err"));
  EXPECT_TRUE(fs::exists(path("map") + "/map.pgm"));
  EXPECT_NE(read_text_file(path("figures.json")).find("\"drives\": 1"), std::string::npos);
}

TEST_F(Recording, BuildMapRefusesBagsOfDifferentBuildings) {
  write([](rosbag::Bag& bag) { fill_room(bag, 10.0, 0.0, 2.0); });
  fs::rename(path(), path("first.bag"));
  write([](rosbag::Bag& bag) { fill_room(bag, 5000.0, -1.0, 9.0); });
  EXPECT_NE(refusal_of_build_map(path("first.bag") + " " + path()).find("drive.bag"), std::string::npos);
}

}  // namespace
}  // namespace knav
