#pragma once

#include "tools/depth_image_recording.h"

namespace knav {

/// Turns the recording's world so that z is up and the floor lies at 0. UserError if no level surface is
/// seen.
void level_poses(DepthImageRecording* recording);

}  // namespace knav
