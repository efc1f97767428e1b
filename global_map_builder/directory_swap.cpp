#include "global_map_builder/directory_swap.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdio.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/error.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

/// Removes the half-written directory unless released.
struct Cleanup {
  fs::path path;
  ~Cleanup() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
};

}  // namespace

void replace_directory(const std::string& directory, const std::function<void(const std::string&)>& write) {
  fs::path target = fs::absolute(directory).lexically_normal();
  if (!target.has_filename()) target = target.parent_path();  // "maps/office/"
  std::error_code failed;
  fs::create_directories(target.parent_path(), failed);
  const Cleanup beside{target.parent_path() /
                       fmt::format(".{}.{}.part", target.filename().string(), getpid())};
  if (failed || !fs::create_directory(beside.path, failed)) {
    throw UserError(
        fmt::format("{}: cannot create a directory there ({}).", target.string(), failed.message()));
  }
  try {
    write(beside.path.string());
  } catch (const fs::filesystem_error& error) {
    throw UserError(fmt::format("{}: cannot be written ({}).", target.string(), error.code().message()));
  }
  if (fs::exists(target)) {
    // Both exist: swap in one step; what was there is then removed by Cleanup.
    if (renameat2(AT_FDCWD, beside.path.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0) return;
    // File systems without exchange (NFS, some FUSE): two renames, the old one aside.
    const Cleanup old{beside.path.string() + ".old"};
    if (rename(target.c_str(), old.path.c_str()) != 0) {
      throw UserError(fmt::format("{}: cannot be replaced ({}).", target.string(), std::strerror(errno)));
    }
    if (rename(beside.path.c_str(), target.c_str()) != 0) {
      const int error = errno;
      fs::rename(old.path, target, failed);
      throw UserError(fmt::format("{}: cannot be replaced ({}).", target.string(), std::strerror(error)));
    }
    return;
  }
  if (rename(beside.path.c_str(), target.c_str()) != 0) {
    throw UserError(fmt::format("{}: cannot be created ({}).", target.string(), std::strerror(errno)));
  }
}

}  // namespace knav
