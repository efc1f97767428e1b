#include "core/file_io.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/error.h"

namespace knav {

void write_file_atomically(const std::string& path, const std::function<void(const std::string&)>& write) {
  namespace fs = std::filesystem;
  const fs::path target(path);
  // Some writers choose the format by the file name's ending: it stays last.
  const std::string beside =
      (target.parent_path() / ("." + target.stem().string() + ".part" + std::to_string(::getpid()) +
                               target.extension().string()))
          .string();
  std::error_code ignored;
  try {
    write(beside);
    std::error_code failed;
    fs::rename(beside, target, failed);
    if (failed) throw UserError(path + ": cannot be written: " + failed.message() + ".");
  } catch (...) {
    fs::remove(beside, ignored);
    throw;
  }
}

void write_text_atomically(const std::string& path, const std::string& text) {
  write_file_atomically(path, [&](const std::string& beside) {
    std::ofstream out(beside, std::ios::binary);
    out << text;
    out.close();
    if (!out) throw UserError(path + ": cannot be written: " + std::strerror(errno) + ".");
  });
}

std::string read_text_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw UserError(path + ": cannot be opened; check the path and its permissions.");
  std::ostringstream text;
  text << in.rdbuf();
  if (in.bad()) throw UserError(path + ": cannot be read.");
  return text.str();
}

}  // namespace knav
