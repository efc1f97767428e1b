#include "brin_benchmark/configurations.h"

#include <filesystem>

#include "core/error.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

/// Beside the program where it is installed, in the source tree where it was built.
fs::path shipped(const std::string& file) {
  std::error_code failed;
  const fs::path program = fs::read_symlink("/proc/self/exe", failed);
  const fs::path installed = program.parent_path() / "../../share/kinect_nav/config" / file;
  if (!failed && fs::exists(installed)) return fs::weakly_canonical(installed);
  return fs::path(KINECT_NAV_SOURCE_DIR) / "config" / file;
}

}  // namespace

std::string configuration_file(const std::string& name_or_path) {
  if (name_or_path.empty() || name_or_path == "default") return "";
  if (fs::exists(name_or_path)) return name_or_path;
  for (const char* name : {"paper_full", "paper_baseline", "paper_literal"}) {
    if (name_or_path == name && fs::exists(shipped(name_or_path + ".yaml")))
      return shipped(name_or_path + ".yaml").string();
  }
  throw UserError(name_or_path +
                  ": no such configuration; give default, paper_full, paper_baseline, paper_literal, external or a YAML file.");
}

}  // namespace knav
