#include "global_map_builder/drive.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "global_map_builder/corrected_drive.h"

namespace knav {
namespace {

constexpr double kSubmapFrameDistance_m = 0.1;
constexpr double kSubmapFrameAngle_rad = 0.07;
constexpr std::size_t kSubmapFrames = 400;

}  // namespace

std::vector<TsdfObservation> observations_near(const Drive& drive, int keyframe, double half_length_m,
                                               const ObservationLimits& limits) {
  const std::vector<Keyframe>& keyframes = drive.keyframes;
  const auto index = static_cast<std::size_t>(keyframe);
  // Not across a break of the mapper's epoch.
  std::size_t first = index, last = index;
  while (first > 0 && !keyframes[first].after_break &&
         keyframes[index].path_m - keyframes[first - 1].path_m <= half_length_m) {
    --first;
  }
  while (last + 1 < keyframes.size() && !keyframes[last + 1].after_break &&
         keyframes[last + 1].path_m - keyframes[index].path_m <= half_length_m) {
    ++last;
  }
  const double end_s = last + 1 < keyframes.size() ? keyframes[last + 1].stamp_s : 1e300;
  const Pose2 T_keyframe_drive = keyframes[index].T_drive_base.inverse();
  const auto& frames = drive.frames;
  const auto before = [](const DriveFrame& frame, double stamp_s) { return frame.stamp_s < stamp_s; };
  auto frame = std::lower_bound(frames.begin(), frames.end(), keyframes[first].stamp_s, before);
  std::vector<TsdfObservation> observations;
  const Pose2* taken = nullptr;
  for (; frame != frames.end() && frame->stamp_s < end_s && observations.size() < kSubmapFrames; ++frame) {
    if (taken != nullptr && distance_m(*taken, frame->T_drive_base) < kSubmapFrameDistance_m &&
        std::fabs(normalize_angle_rad(taken->yaw_rad - frame->T_drive_base.yaw_rad)) <
            kSubmapFrameAngle_rad) {
      continue;
    }
    taken = &frame->T_drive_base;
    TsdfObservation& observation = observations.emplace_back();
    std::visit([&](const auto& data) { observation_from(data, limits, &observation); }, frame->data);
    observation.T_map_sensor = T_keyframe_drive * frame->T_drive_base * frame->T_base_sensor;
  }
  return observations;
}

void Drive::adjust(const std::vector<Pose2>& T_drive_keyframe, const std::vector<Eigen::Matrix3d>& added) {
  const CorrectedDrive corrected(keyframes, T_drive_keyframe);
  for (DriveFrame& frame : frames) frame.T_drive_base = corrected.at(frame.stamp_s, frame.T_drive_base);
  for (StampedPose2& pose : trajectory) pose.T_map_robot = corrected.at(pose.stamp_s, pose.T_map_robot);
  for (std::size_t i = 0; i < keyframes.size(); ++i) keyframes[i].T_drive_base = T_drive_keyframe[i];
  for (std::size_t i = 0; i < edges.size(); ++i) {
    edges[i].T_from_to = T_drive_keyframe[i].inverse() * T_drive_keyframe[i + 1];
    edges[i].information = (edges[i].information.inverse() + added[i]).inverse();
  }
}

}  // namespace knav
