#pragma once

#include <string>
#include <vector>

namespace knav {

/// The sections a configuration file may have: one per node, and what the benchmark alone reads.
const std::vector<std::string>& config_section_names();

/// One file serves every program, each of which reads its own sections only: a section with a slip in its name would be
/// silently nobody's. UserError, with a suggestion; "" is no file.
void refuse_unknown_sections(const std::string& path);

}  // namespace knav
