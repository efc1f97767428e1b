// check_robot: what is right passes, and each fault shows in its own line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "kinect_calib/robot_check.h"
#include "test/kinect_calib/simulated_drive.h"

namespace knav {
namespace {

using Status = CheckItem::Status;

struct Variant {
  std::function<void(double* stamp_s, Pose2* pose)> odometry;
  std::function<void(Eigen::Isometry3d* T)> mount;
  int odometry_step = 1;
  RobotCheck check{RobotCheckConfig{}};
};

std::vector<std::string> problems(const RobotCheck& check) {
  std::vector<std::string> names;
  for (const CheckItem& item : check.checklist()) {
    if (item.status == Status::kOk) continue;
    names.push_back(item.name);
    EXPECT_FALSE(item.to_do.empty()) << item.name;
  }
  return names;
}

CheckItem item(const RobotCheck& check, const std::string& name) {
  for (const CheckItem& item : check.checklist())
    if (item.name == name) return item;
  return {};
}

TEST(RobotCheck, EachFaultOfADriveShowsInItsOwnLine) {
  enum { kRight, kYawReversed, kBackwards, kLate, kTooHigh, kSlow, kCount };
  std::vector<Variant> variants(kCount);
  variants[kYawReversed].odometry = [](double*, Pose2* pose) {
    pose->yaw_rad = -pose->yaw_rad, pose->y_m = -pose->y_m;
  };
  // The wheels' sign is wrong for driving: the pose runs backwards along the true heading.
  variants[kBackwards].odometry = [](double*, Pose2* pose) {
    pose->x_m = -pose->x_m, pose->y_m = -pose->y_m;
  };
  variants[kLate].odometry = [](double* stamp_s, Pose2*) { *stamp_s += 0.08; };
  variants[kTooHigh].mount = [](Eigen::Isometry3d* T) { T->translation().z() += 0.1; };
  variants[kSlow].odometry_step = 10;
  SimulatedDrive drive;
  drive.config = tilted_camera();
  drive.config.odometry = "perfect";
  int odometry = 0;
  drive.frame = [&](const cv::Mat& depth, const Simulator& simulator, double stamp_s) {
    for (Variant& variant : variants) {
      Eigen::Isometry3d T = simulator.T_base_optical();
      if (variant.mount) variant.mount(&T);
      variant.check.set_mount(T, "");
      variant.check.set_odometry_tf(true, "");
      variant.check.add_camera_info(simulator.camera());
      variant.check.add_frame(stamp_s, stamp_s + 0.04, depth);
    }
  };
  drive.odometry = [&](double stamp_s, const Pose2& pose) {
    ++odometry;
    for (Variant& variant : variants) {
      if (odometry % variant.odometry_step != 0) continue;
      double stamp = stamp_s;
      Pose2 changed = pose;
      if (variant.odometry) variant.odometry(&stamp, &changed);
      variant.check.add_odometry(stamp, stamp_s + 0.002, changed);
    }
  };
  drive.run();
  using testing::Contains;
  EXPECT_THAT(problems(variants[kRight].check), testing::IsEmpty())
      << item(variants[kRight].check, "depth/rate").found;
  EXPECT_THAT(item(variants[kYawReversed].check, "odometry/turn").to_do,
              testing::HasSubstr("reverse its sign"));
  EXPECT_THAT(problems(variants[kBackwards].check), testing::ElementsAre("odometry/drive"));
  EXPECT_THAT(item(variants[kBackwards].check, "odometry/drive").to_do, testing::HasSubstr("nearer"));
  EXPECT_THAT(problems(variants[kLate].check), Contains("time_offset"));
  EXPECT_THAT(problems(variants[kTooHigh].check), testing::ElementsAre("mount/floor"));
  EXPECT_THAT(problems(variants[kSlow].check), Contains("odometry/rate"));
}

TEST(RobotCheck, NothingArrivingIsSaidLineByLine) {
  const RobotCheck check{RobotCheckConfig{}};
  EXPECT_THAT(problems(check), testing::IsSupersetOf({"depth/rate", "camera_info", "tf/camera", "tf/odometry",
                                                      "odometry/rate", "mount/floor", "odometry/turn"}));
  EXPECT_FALSE(RobotCheck::passed(check.checklist()));
}

TEST(RobotCheck, StampsAndFormatAndSizeAndBlindness) {
  RobotCheckConfig config;
  config.standing = true;
  RobotCheck check(config);
  check.add_camera_info({320, 240, 292.5, 292.5, 159.5, 119.5});
  const cv::Mat blind(480, 640, CV_32FC1, std::numeric_limits<float>::quiet_NaN());
  for (int i = 0; i < 60; ++i) check.add_frame(0.0, 100.0 + i / 30.0, blind);
  check.add_bad_frame(0.0, 102.0, "the image has encoding 'rgb8'");
  EXPECT_EQ(item(check, "depth/rate").status, Status::kOk);
  EXPECT_EQ(item(check, "depth/stamps").status, Status::kProblem);
  EXPECT_EQ(item(check, "depth/format").status, Status::kProblem);
  EXPECT_EQ(item(check, "depth/valid").status, Status::kProblem);
  EXPECT_EQ(item(check, "camera_info").status, Status::kProblem);
}

}  // namespace
}  // namespace knav
