#pragma once

#include <functional>
#include <string>

namespace knav {

/// Calls write(directory_beside) on a fresh directory, then renames it to `directory`; an existing directory
/// is swapped out in the same instant and removed. If write throws, nothing remains of it and the old
/// directory stays.
void replace_directory(const std::string& directory, const std::function<void(const std::string&)>& write);

}  // namespace knav
