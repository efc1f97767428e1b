#pragma once

#include <functional>
#include <string>

namespace knav {

/// Calls write(path_beside), then renames the file it wrote to `path`: readers see the old file or the whole new
/// one, never a part. On any failure the part is removed and UserError or the original exception goes on.
void write_file_atomically(const std::string& path, const std::function<void(const std::string&)>& write);

/// The same for a text held in memory.
void write_text_atomically(const std::string& path, const std::string& text);

/// The whole file; UserError if it cannot be read.
std::string read_text_file(const std::string& path);

}  // namespace knav
