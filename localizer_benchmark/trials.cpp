#include "localizer_benchmark/trials.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/progress.h"
#include "core/random.h"
#include "ros_common/program.h"

namespace knav {
namespace {

constexpr double kStartLength_s = 30.5, kStartsApart_s = 5.3, kView_s = 10.0;
constexpr double kKidnapLength_s = 47.0, kWarmUp_s = 25.0;
constexpr double kCarried_m = 3.0;       // at least
constexpr double kTurning_radps = 0.4, kLooksRound_s = 5.0;
constexpr std::size_t kAmbiguousAtMost = 40;

std::size_t frame_after(const ProfileRecording& drive, std::size_t from, double seconds) {
  std::size_t i = from;
  while (i < drive.frames() && drive.stamp_s(i) < drive.stamp_s(from) + seconds) ++i;
  return i;
}

/// Frames at which the robot begins to turn on the spot for a while.
std::vector<std::size_t> looks_round(const ProfileRecording& drive) {
  std::vector<std::size_t> found;
  std::size_t begin = 0;
  bool turning = false;
  Pose2 last;
  double last_s = 0.0;
  for (std::size_t i = 0; i < drive.frames(); i += 6) {
    Pose2 T;
    if (!interpolate_at(drive.truth, drive.stamp_s(i), 1.0, &T)) continue;
    const double dt = drive.stamp_s(i) - last_s;
    const bool now = i > 0 && std::fabs(normalize_angle_rad(T.yaw_rad - last.yaw_rad)) > kTurning_radps * dt && distance_m(T, last) < 0.1 * dt;
    if (now && !turning) begin = i;
    if (!now && turning && drive.stamp_s(i) - drive.stamp_s(begin) > kLooksRound_s) found.push_back(begin);
    turning = now;
    last = T;
    last_s = drive.stamp_s(i);
  }
  return found;
}

}  // namespace

Starts find_starts(const std::vector<ProfileRecording>& drives, const DistanceMap& world_map, std::size_t wanted) {
  const UniquePlaces places(world_map);
  Starts starts;
  Progress progress("find starts");
  struct Moment {
    std::size_t drive, frame;
  };
  std::vector<Moment> moments;
  for (std::size_t d = 0; d < drives.size(); ++d) {
    for (std::size_t i = frame_after(drives[d], 0, 2.0); i < drives[d].frames(); i = frame_after(drives[d], i, kStartsApart_s)) {
      if (frame_after(drives[d], i, kStartLength_s) < drives[d].frames()) moments.push_back({d, i});
    }
  }
  // every seventh first, so that few of them are spread over all drives as well
  for (std::size_t phase = 0; phase < 7 && starts.unique.size() < wanted; ++phase) {
    for (std::size_t k = phase; k < moments.size() && starts.unique.size() < wanted; k += 7) {
      const ProfileRecording& drive = drives[moments[k].drive];
      const std::vector<Point2> view = true_view(drive, moments[k].frame, kView_s);
      Pose2 T_world_view, other;
      interpolate_at(drive.truth, drive.stamp_s(moments[k].frame), 1.0, &T_world_view);
      if (view.size() < 60 || places.fit(view, T_world_view) < 0.95) continue;  // nothing to see, or changed
      const Stretch stretch{moments[k].drive, moments[k].frame, frame_after(drive, moments[k].frame, kStartLength_s)};
      if (places.unique(view, T_world_view, &other)) {
        starts.unique.push_back(stretch);
      } else if (starts.ambiguous.size() < kAmbiguousAtMost) {
        starts.ambiguous.push_back(stretch);
      }
      stop_if_interrupted();
      progress.update(static_cast<double>(starts.unique.size()) / static_cast<double>(wanted));
    }
  }
  return starts;
}

std::vector<Stretch> lay_out_kidnaps(const std::vector<ProfileRecording>& drives, std::size_t wanted, int seed) {
  std::vector<Stretch> landings;
  RandomStream random(static_cast<std::uint64_t>(seed), random_stream::kChanges, 0, 4);
  for (std::size_t d = 0; d < drives.size(); ++d) {
    for (const std::size_t look : looks_round(drives[d])) landings.push_back({d, look, 0});
  }
  if (landings.size() < 3) throw UserError("the drives have no three looks round to be carried to.");
  std::vector<Stretch> stretches{{0, 0, frame_after(drives[0], 0, kWarmUp_s)}};
  const auto pose_at = [&](const Stretch& s, std::size_t frame) {
    Pose2 T;
    interpolate_at(drives[s.drive].truth, drives[s.drive].stamp_s(std::min(frame, drives[s.drive].frames() - 1)), 1.0, &T);
    return T;
  };
  for (int attempt = 0; attempt < 1000 && stretches.size() < wanted + 1; ++attempt) {
    Stretch s = landings[std::min(landings.size() - 1, static_cast<std::size_t>(random.uniform() * static_cast<double>(landings.size())))];
    const ProfileRecording& drive = drives[s.drive];
    const double before_s = random.uniform(2.0, 5.0);
    const auto back = static_cast<std::size_t>(before_s * 30.0);
    s.first = s.first > back ? s.first - back : 0;
    s.last = frame_after(drive, s.first, kKidnapLength_s);
    const Stretch& before = stretches.back();
    if (s.last >= drive.frames() || distance_m(pose_at(before, before.last), pose_at(s, s.first)) < kCarried_m) continue;
    stretches.push_back(s);
  }
  return stretches;
}

}  // namespace knav
