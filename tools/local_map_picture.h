#pragma once

#include <string>

namespace knav {

class LocalMapper;

/// Writes three pictures of the mapper's state into a folder (made if absent): `tsdf.png` (the signed distance: white
/// to red in front of surfaces, blue behind, grey unknown; the paper's figure 3), `local_map.png` (the occupancy
/// grid), `scan_360.png` (the virtual scan on top of the grid, fresh rays green, old ones orange).
void write_local_map_pictures(const std::string& folder, const LocalMapper& mapper);

}  // namespace knav
