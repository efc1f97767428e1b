#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "core/error.h"
#include "core/file_io.h"

namespace knav {
namespace {

class FileIo : public testing::Test {
 protected:
  FileIo() : dir_(std::filesystem::temp_directory_path() / ("knav_file_io_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(dir_);
  }
  ~FileIo() override { std::filesystem::remove_all(dir_); }
  std::filesystem::path dir_;
};

TEST_F(FileIo, FailedWriteLeavesTheOldFileAndNoPart) {
  const std::string path = dir_ / "map.yaml";
  write_text_atomically(path, "old");
  EXPECT_THROW(write_file_atomically(path,
                                     [](const std::string& beside) {
                                       std::ofstream(beside) << "half";
                                       throw std::runtime_error("disk full");
                                     }),
               std::runtime_error);
  EXPECT_EQ(read_text_file(path), "old");
  const auto entries = std::distance(std::filesystem::directory_iterator(dir_), {});
  EXPECT_EQ(entries, 1);
}

TEST_F(FileIo, UnwritableDirectoryIsNamed) {
  try {
    write_text_atomically(dir_ / "absent" / "x.txt", "text");
    FAIL();
  } catch (const UserError& error) {
    EXPECT_NE(std::string(error.what()).find("absent/x.txt"), std::string::npos);
  }
}

}  // namespace
}  // namespace knav
