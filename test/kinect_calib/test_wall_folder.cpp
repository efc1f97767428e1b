#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/file_io.h"
#include "kinect_calib/wall_folder.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

class WallFolderTest : public ::testing::Test {
 protected:
  void TearDown() override { fs::remove_all(path_); }
  const std::string path_ =
      (fs::temp_directory_path() / ("wall_folder_" + std::to_string(::getpid()))).string();
  const cv::Mat near_ = cv::Mat(48, 64, CV_16UC1, cv::Scalar(551)),
                far_ = cv::Mat(48, 64, CV_16UC1, cv::Scalar(612));
  const RawCamera camera_ = {{64, 48, 58.5, 58.5, 31.5, 23.5}, {}, {64, 48, 58.5, 58.5, 31.5, 23.5}};
};

TEST_F(WallFolderTest, HoldsWhatWasAddedAndGoesOnWithIt) {
  {
    WallFolder folder(path_, false);
    folder.set_camera(camera_, "depth_test");
    EXPECT_TRUE(folder.distances_m().empty());
    folder.add({near_, near_}, 0.55);
  }
  // A run that broke off between its images and distances.csv.
  cv::imwrite(path_ + "/wall_02_01.png", near_);
  EXPECT_THROW(WallFolder(path_, false), UserError) << "never over what is there";
  WallFolder folder(path_, true);
  EXPECT_THAT(folder.distances_m(), ::testing::ElementsAre(0.55));
  folder.set_camera(camera_, "depth_test");
  folder.add({far_}, 0.61236);
  EXPECT_THAT(folder.distances_m(), ::testing::ElementsAre(0.55, 0.6124));

  const std::vector<WallFrame> frames = read_distances(path_);
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[2].file, "wall_02_01.png");
  const cv::Mat read = cv::imread(path_ + "/" + frames[2].file, cv::IMREAD_UNCHANGED);
  EXPECT_EQ(read.type(), CV_16UC1);
  EXPECT_EQ(cv::norm(read, far_, cv::NORM_INF), 0.0);
  EXPECT_EQ(read_camera_info(path_ + "/camera_info.yaml").raw.fx_px, 58.5);
  for (const auto& entry : fs::directory_iterator(path_)) EXPECT_NE(entry.path().filename().string()[0], '.');
}

TEST_F(WallFolderTest, RefusesAnotherCamera) {
  WallFolder folder(path_, false);
  folder.set_camera(camera_, "depth_test");
  RawCamera other = camera_;
  other.raw.fx_px = 52.5;
  EXPECT_THROW(folder.set_camera(other, "depth_test"), UserError);
}

TEST_F(WallFolderTest, AFaultNamesFileAndLine) {
  fs::create_directories(path_);
  write_text_atomically(path_ + "/distances.csv", "file,distance_m\na.png,0.5\nb.png\n");
  try {
    read_distances(path_);
    FAIL();
  } catch (const UserError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("distances.csv: line 3"));
  }
  write_text_atomically(path_ + ".txt", "no folder");
  EXPECT_THROW(WallFolder(path_ + ".txt", false), UserError);
  fs::remove(path_ + ".txt");
}

}  // namespace
}  // namespace knav
