#pragma once

#include <functional>

#include "global_map_builder/drive.h"
#include "global_map_builder/map_builder_config.h"

namespace knav {

/// Sets right single keyframes of a scanner's drive before closures are sought. Where the robot turns quickly and odometry came
/// late, the mapper leaves a frame or two some degrees beside the truth and goes on as if nothing had been; a closure at such a
/// keyframe is wrong by as much, however well the local maps match. Every keyframe is tried at other headings against those
/// a little before and after it, and takes the one at which clearly more of what it sees fits.
/// A depth camera's drive is left as it is: its frames come thirty times a second, and show too little each.
/// @return the number of keyframes set right
int settle_scans(const SettlingConfig& config, const JointRefinementConfig& views, Drive* drive,
                 const std::function<void(double)>& progress);

}  // namespace knav
