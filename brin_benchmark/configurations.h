#pragma once

#include <string>

namespace knav {

/// The file of a configuration given by name (`default`, `paper_full`, `paper_baseline`, `paper_literal`: in the package's config folder)
/// or by path; empty for `default`. UserError if there is no such file.
std::string configuration_file(const std::string& name_or_path);

}  // namespace knav
