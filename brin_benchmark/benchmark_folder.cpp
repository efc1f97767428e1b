#include "brin_benchmark/benchmark_folder.h"

#include <fmt/format.h>

#include <filesystem>

#include "core/error.h"
#include "core/file_io.h"

namespace fs = std::filesystem;

namespace knav {

nlohmann::json read_json(const std::string& path) {
  try {
    return nlohmann::json::parse(read_text_file(path));
  } catch (const nlohmann::json::exception& error) {
    throw UserError(path + ": " + error.what());
  }
}

void claim_folder(const std::string& folder, const nlohmann::json& identity, const std::string& what) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw UserError(folder + ": cannot be made: " + failed.message() + ".");
  const std::string setup_file = folder + "/setup.json";
  if (!fs::exists(setup_file)) {
    write_text_atomically(setup_file, identity.dump(1) + "\n");
    return;
  }
  const nlohmann::json before = read_json(setup_file);
  for (const auto& [key, value] : identity.items()) {
    if (before.value(key, nlohmann::json()) == value) continue;
    throw UserError(fmt::format("{}: holds {} with another '{}'; choose another folder, or remove it.", folder, what, key));
  }
}

}  // namespace knav
