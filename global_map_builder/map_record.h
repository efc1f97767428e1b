#pragma once

#include <string>
#include <vector>

#include "core/pose2.h"
#include "global_map_builder/closure.h"
#include "global_map_builder/drive.h"

namespace knav {

/// What a map was made of: enough to add to it later.
struct MapRecord {
  std::vector<Drive> drives;
  std::vector<Pose2> T_map_keyframe;  ///< of all drives' keyframes, one after the other
  std::vector<Closure> closures;      ///< by those numbers; without their points

  /// Of a keyframe's number.
  int drive_of(int keyframe) const;
  const Keyframe& keyframe(int number) const;
};

/// The file `drives.bin` of a map directory: little endian, compressed, with a checksum. Ranges are kept to a
/// millimetre (a scanner's beyond 65 m more coarsely). UserError if it cannot be written.
void write_map_record(const std::string& path, const MapRecord& record);
/// UserError if the file is missing, damaged, or of a newer version.
MapRecord read_map_record(const std::string& path);

}  // namespace knav
