#include "localizer_benchmark/measures.h"

#include <algorithm>
#include <cmath>

#include "ros_common/program.h"

namespace knav {
namespace {

constexpr double kStartLimit_s = 30.0;
constexpr double kLost_m = 1.0, kLostFor_s = 5.0;

Eigen::Matrix3d placing_covariance() { return Eigen::Vector3d(0.1 * 0.1, 0.1 * 0.1, 0.05 * 0.05).asDiagonal(); }

Moment ask(Localizer& localizer, const ScanRecording& drive, std::size_t i, const MapInWorld& map, RangeScan* scan) {
  const ScanRecording::Frame& frame = drive.frames[i];
  drive.scan(i, scan);
  const LocalizerResult& r = localizer.update(*scan, drive.T_base_sensor, frame.T_local_base, frame.epoch, &frame.T_odom_base);
  Moment moment;
  moment.stamp_s = frame.stamp_s;
  if (i + 1 < drive.frames.size()) moment.dt_s = std::clamp(drive.frames[i + 1].stamp_s - frame.stamp_s, 0.0, 0.2);
  moment.has_pose = r.has_pose;
  moment.verdict = r.verdict;
  moment.support = r.support;
  moment.fresh_support = r.fresh_support;
  moment.T_world_base = frame.T_world_base;
  const Pose2 T_world_base = map.T_world_map * r.T_map_base;
  moment.error_m = distance_m(T_world_base, frame.T_world_base);
  moment.error_rad = std::fabs(normalize_angle_rad(T_world_base.yaw_rad - frame.T_world_base.yaw_rad));
  return moment;
}

std::size_t end_of(const ScanRecording& drive, std::size_t stretch) {
  return stretch + 1 < drive.begins.size() ? drive.begins[stretch + 1] : drive.frames.size();
}

}  // namespace

void TrackingScore::add(const TrackingScore& o) {
  honesty.add(o.honesty);
  path_m += o.path_m;
  error_m.insert(error_m.end(), o.error_m.begin(), o.error_m.end());
  error_rad.insert(error_rad.end(), o.error_rad.begin(), o.error_rad.end());
  lost_spans += o.lost_spans;
  if (o.worst_m > worst_m) {
    worst_m = o.worst_m;
    worst_s = o.worst_s;
    worst_x_m = o.worst_x_m;
    worst_y_m = o.worst_y_m;
  }
}

void RecoveryScore::add(const RecoveryScore& o) {
  honesty.add(o.honesty);
  trials += o.trials;
  noticed += o.noticed;
  right += o.right;
  noticed_s.insert(noticed_s.end(), o.noticed_s.begin(), o.noticed_s.end());
  right_s.insert(right_s.end(), o.right_s.begin(), o.right_s.end());
  for (const auto& e : o.each) each.push_back(e);
}

TrackingScore measure_tracking(const ScanRecording& drive, const MapInWorld& map, const LocalizerConfig& config,
                               std::vector<Moment>* moments) {
  TrackingScore score;
  Localizer localizer(config);
  localizer.set_map(map.map);
  localizer.initialize(map.T_world_map.inverse() * drive.frames.front().T_world_base, placing_covariance());
  RangeScan scan;
  double off_s = 0.0;
  for (std::size_t i = 0; i < drive.frames.size(); ++i) {
    const Moment m = ask(localizer, drive, i, map, &scan);
    if (moments) moments->push_back(m);
    score.honesty.add(m);
    if (i > 0) score.path_m += distance_m(drive.frames[i - 1].T_world_base, drive.frames[i].T_world_base);
    score.error_m.push_back(static_cast<float>(m.error_m));
    score.error_rad.push_back(static_cast<float>(m.error_rad));
    if (m.error_m > score.worst_m) {
      score.worst_m = m.error_m;
      score.worst_s = m.stamp_s - drive.frames.front().stamp_s;
      score.worst_x_m = drive.frames[i].T_world_base.x_m;
      score.worst_y_m = drive.frames[i].T_world_base.y_m;
    }
    const bool was = off_s > kLostFor_s;
    off_s = m.error_m > kLost_m ? off_s + m.dt_s : 0.0;
    if (!was && off_s > kLostFor_s) ++score.lost_spans;
    if (i % 300 == 0) stop_if_interrupted();
  }
  return score;
}

RecoveryScore measure_starts(const ScanRecording& starts, const MapInWorld& map, const LocalizerConfig& config) {
  RecoveryScore score;
  Localizer localizer(config);
  localizer.set_map(map.map);
  RangeScan scan;
  for (std::size_t k = 0; k < starts.begins.size(); ++k) {
    localizer.reset();
    const std::size_t begin = starts.begins[k], end = end_of(starts, k);
    if (begin == end) continue;
    ++score.trials;
    double right_s = -1.0, wrong_s = 0.0;
    Moment m;
    for (std::size_t i = begin; i < end; ++i) {
      m = ask(localizer, starts, i, map, &scan);
      if (i + 1 == end) m.dt_s = 0.0;
      const double since_s = m.stamp_s - starts.frames[begin].stamp_s;
      if (since_s > kStartLimit_s) break;
      score.honesty.add(m);
      if (m.ok() && m.error_m > kWrong_m) wrong_s += m.dt_s;
      if (right_s < 0.0 && m.ok() && is_right(m)) right_s = since_s;
    }
    if (right_s >= 0.0) {
      ++score.right;
      score.right_s.push_back(right_s);
    }
    const Pose2& at = starts.frames[begin].T_world_base;
    score.each.push_back({{"x_m", at.x_m}, {"y_m", at.y_m}, {"yaw_rad", at.yaw_rad}, {"right_s", right_s}, {"ok_wrong_s", wrong_s}, {"at_end", verdict_name(m.verdict)}, {"error_at_end_m", m.has_pose ? m.error_m : -1.0}});
    stop_if_interrupted();
  }
  return score;
}

KidnappedLocalizer::KidnappedLocalizer(const MapInWorld& map, const LocalizerConfig& config) : map_(map), localizer_(config) {
  localizer_.set_map(map.map);
}

Moment KidnappedLocalizer::ask(const ScanRecording& drive, std::size_t i) {
  const auto place = [&] { localizer_.initialize(map_.T_world_map.inverse() * drive.frames[i].T_world_base, placing_covariance()); };
  if (i == 0) place();
  const std::size_t begin = *std::prev(std::upper_bound(drive.begins.begin(), drive.begins.end(), i));
  if (i == begin) helped_ = false;
  const double since_s = drive.frames[i].stamp_s - drive.frames[begin].stamp_s;
  if (since_s > kKidnapLimit_s && !helped_ && !(last_.ok() && is_right(last_))) {
    place();  // the next trial is to begin from a robot that knows where it is
    helped_ = true;
  }
  last_ = knav::ask(localizer_, drive, i, map_, &scan_);
  return last_;
}

RecoveryScore measure_kidnaps(const ScanRecording& drive, const MapInWorld& map, const LocalizerConfig& config,
                              std::vector<Moment>* moments) {
  RecoveryScore score;
  KidnappedLocalizer localizer(map, config);
  bool was_right = true;
  for (std::size_t k = 0; k < drive.begins.size(); ++k) {
    const std::size_t begin = drive.begins[k], end = end_of(drive, k);
    if (begin == end) continue;
    const std::uint32_t epoch_before = begin > 0 ? drive.frames[begin - 1].epoch : 0;
    KidnapWatch watch(drive.frames[begin].stamp_s);
    double epoch_s = -1.0;
    Moment m;
    for (std::size_t i = begin; i < end; ++i) {
      const double since_s = drive.frames[i].stamp_s - drive.frames[begin].stamp_s;
      m = localizer.ask(drive, i);
      if (moments) moments->push_back(m);
      if (since_s <= kKidnapLimit_s && k > 0) {
        watch.add(m);
        if (!watch.forgiven(m)) score.honesty.add(m);
        if (epoch_s < 0.0 && drive.frames[i].epoch != epoch_before) epoch_s = since_s;
      }
    }
    const bool ready = was_right;
    was_right = m.ok() && is_right(m);
    if (k == 0) continue;
    ++score.trials;
    const KidnapRecovery& recovery = watch.recovery();
    if (recovery.noticed()) {
      ++score.noticed;
      score.noticed_s.push_back(recovery.noticed_s);
    }
    if (recovery.right()) {
      ++score.right;
      score.right_s.push_back(recovery.right_s);
    }
    const Pose2& at = drive.frames[begin].T_world_base;
    score.each.push_back({{"x_m", at.x_m}, {"y_m", at.y_m}, {"yaw_rad", at.yaw_rad}, {"noticed_s", recovery.noticed_s}, {"right_s", recovery.right_s}, {"ok_wrong_s", recovery.ok_wrong_s}, {"mapper_noticed_s", epoch_s}, {"knew_before", ready}});
    stop_if_interrupted();
  }
  return score;
}

}  // namespace knav
