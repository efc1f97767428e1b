#pragma once

#include <algorithm>
#include <vector>

#include "global_map_builder/drive.h"

namespace knav {

/// Carries the graph's correction of the keyframes to any pose of the drive: hung on the keyframe before and
/// on the one after, blended by time, so that nothing jumps at a keyframe.
class CorrectedDrive {
 public:
  CorrectedDrive(const std::vector<Keyframe>& keyframes, const std::vector<Pose2>& T_map_keyframe) {
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
      stamp_s_.push_back(keyframes[i].stamp_s);
      after_break_.push_back(keyframes[i].after_break);
      T_map_drive_.push_back(T_map_keyframe[i] * keyframes[i].T_drive_base.inverse());
    }
  }

  Pose2 at(double stamp_s, const Pose2& T_drive_base) const {
    const auto after = static_cast<std::size_t>(std::upper_bound(stamp_s_.begin(), stamp_s_.end(), stamp_s) -
                                                stamp_s_.begin());
    const std::size_t before = after > 0 ? after - 1 : 0;
    const Pose2 hung_before = T_map_drive_[before] * T_drive_base;
    if (after >= stamp_s_.size() || after == before || after_break_[after]) return hung_before;
    const double t = (stamp_s - stamp_s_[before]) / (stamp_s_[after] - stamp_s_[before]);
    return interpolate(hung_before, T_map_drive_[after] * T_drive_base, t);
  }

 private:
  std::vector<double> stamp_s_;
  std::vector<bool> after_break_;
  std::vector<Pose2> T_map_drive_;
};

}  // namespace knav
