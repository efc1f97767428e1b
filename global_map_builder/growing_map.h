#pragma once

#include <memory>

#include "global_map_builder/dense_tsdf.h"
#include "global_map_builder/drive.h"

namespace knav {

/// A coarse map of a drive that is still going on, as the local mapper sees it (loops are closed when the map
/// is built). Every update takes in the frames that are new; the grid grows with the drive.
class GrowingMap {
 public:
  /// @param surface     as for the map
  /// @param resolution_m its cells may be larger
  GrowingMap(const SurfaceConfig& surface, double resolution_m);

  void update(const Drive& drive);
  /// 0 free, 100 occupied, -1 unknown, in the drive's frame; empty before the first frame.
  OccupancyGrid grid() const;

 private:
  SurfaceConfig surface_;
  std::unique_ptr<DenseTsdf> tsdf_;
  std::size_t taken_ = 0;  ///< frames
};

}  // namespace knav
