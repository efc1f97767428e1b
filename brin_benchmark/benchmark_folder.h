#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace knav {

/// UserError if the file cannot be read or is no JSON.
nlohmann::json read_json(const std::string& path);

/// Makes a benchmark's folder and writes into it (setup.json) what its files depend on; or checks, where it is there already, that it
/// holds the same, so that they can be gone on with. UserError otherwise, with the first key that differs.
/// @param what  what such a folder holds, for the message
void claim_folder(const std::string& folder, const nlohmann::json& identity, const std::string& what);

}  // namespace knav
