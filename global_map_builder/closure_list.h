#pragma once

#include <string>
#include <vector>

#include "global_map_builder/map_builder.h"

namespace knav {

/// The user's allow / deny list: YAML, one entry a pair, as write_closure_list() writes it. Entries with the
/// verdict `auto` are left out. UserError names file and entry.
std::vector<ListedClosure> read_closure_list(const std::string& path);

/// Every closure looked at with what was made of it, to be edited and given back.
void write_closure_list(const std::string& path, const MapRecord& record);

}  // namespace knav
