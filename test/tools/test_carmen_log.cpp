#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "core/error.h"
#include "core/file_io.h"
#include "tools/carmen_log.h"

namespace knav {
namespace {

class CarmenLogFile : public testing::Test {
 protected:
  CarmenLogFile()
      : path_(std::filesystem::temp_directory_path() / ("knav_" + std::to_string(::getpid()) + ".clf")) {}
  ~CarmenLogFile() override { std::filesystem::remove(path_); }
  std::string fault_of(const std::string& text) {
    write_text_atomically(path_, text);
    try {
      read_carmen_log(path_);
    } catch (const UserError& error) {
      return error.what();
    }
    return "";
  }
  std::string path_;
};

TEST_F(CarmenLogFile, ReadsScanAndOdometryLines) {
  write_text_atomically(path_,
                        "# comment\nODOM 1 2 0.5 0.1 0.2 0 100.25 host 0.0\n"
                        "FLASER 3 1.5 81.91 2.5 1.1 2 0.5 1 2 0.5 100.5 host 0.1\n");
  const CarmenLog log = read_carmen_log(path_);
  ASSERT_EQ(log.scans.size(), 1u);
  EXPECT_THAT(log.scans[0].range_m, testing::ElementsAre(1.5f, 81.91f, 2.5f));
  EXPECT_DOUBLE_EQ(log.scans[0].T_odom_laser.x_m, 1.1);
  EXPECT_DOUBLE_EQ(log.scans[0].T_odom_robot.x_m, 1.0);
  EXPECT_DOUBLE_EQ(log.scans[0].stamp_s, 100.5);
  ASSERT_EQ(log.odometry.size(), 1u);
  EXPECT_DOUBLE_EQ(log.odometry[0].stamp_s, 100.25);
}

TEST_F(CarmenLogFile, FaultsNameFileAndLine) {
  EXPECT_THAT(fault_of("FLASER 3 1.5 2.5\n"), testing::AllOf(testing::HasSubstr(path_), testing::HasSubstr("line 1")));
  EXPECT_THAT(fault_of("#\nFLASER 3 1 x 2 0 0 0 0 0 0 1 h 1\n"), testing::HasSubstr("line 2: 'x' is not a number"));
  EXPECT_THAT(fault_of("FLASER 99999999 1\n"), testing::HasSubstr("impossible"));
  EXPECT_THAT(fault_of(""), testing::HasSubstr("no FLASER line"));
}

}  // namespace
}  // namespace knav
