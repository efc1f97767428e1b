#include "tsdf_localizer/localizer.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/config.h"
#include "tsdf_localizer/belief.h"
#include "tsdf_localizer/health.h"
#include "tsdf_localizer/map_fields.h"
#include "tsdf_localizer/pose_check.h"
#include "tsdf_localizer/pose_search.h"
#include "tsdf_localizer/scan_rays.h"

namespace knav {

const char* verdict_name(LocalizationVerdict verdict) {
  switch (verdict) {
    case LocalizationVerdict::kOk:
      return "ok";
    case LocalizationVerdict::kUncertain:
      return "uncertain";
    case LocalizationVerdict::kLost:
      return "lost";
    default:
      return "initializing";
  }
}

namespace {
constexpr int kGivenPoseScans = 15;  ///< as many old ones are on their way at most, half a second of them
}  // namespace

struct Localizer::State {
  explicit State(const LocalizerConfig& c) : config(c), belief(c), health(c.health), search(c) {}

  void refuse(const char* why);
  void take_motion(const Pose2& T_local_base, std::uint32_t epoch, const Pose2* T_odom_base);
  void take_motion_after_given_pose(std::uint32_t epoch);
  void begin_epoch(std::uint32_t epoch, const Pose2* T_odom_base);
  void filter(double stamp_s);
  void judge(double stamp_s);
  void decide();
  void break_with_the_past();
  double evidence_min(double stamp_s) const;
  double evidence_power() const;
  Pose2 pose_now() { return belief.estimate().pose.mean * T_filter_now; }

  LocalizerConfig config;
  MapFields fields;
  Belief belief;
  Health health;
  PoseSearch search;
  LocalizerResult result;

  ScanRays rays;
  PoseCheck check;
  std::size_t scans = 0;
  bool has_motion = false, forced = true, lost = false;
  std::uint32_t epoch = 0;
  Pose2 T_local_last, T_odom_last,
      T_filter_now;  ///< the last is the motion that the belief has not been told yet
  bool has_odom = false;
  int given_pose_scans = 0;  ///< scans left in which a new epoch belongs to the pose that was given
  double last_s = 0.0, filtered_s = 0.0;
  /// What was seen before is not to be trusted: perhaps the robot was carried away then. While it is in doubt, and after, if
  /// it turns out to be elsewhere.
  std::optional<double> break_s;
  Pose2 T_tracked;  ///< where it would be now had it not been carried
};

Localizer::Localizer(const LocalizerConfig& config) : state_(std::make_unique<State>(config)) {
  const auto faults = config.validate();
  if (!faults.empty()) throw_faults(faults);
  reset();
}
Localizer::~Localizer() = default;
Localizer::Localizer(Localizer&&) noexcept = default;
Localizer& Localizer::operator=(Localizer&&) noexcept = default;

void Localizer::set_map(const DistanceMap& map) {
  state_->fields = make_map_fields(map, state_->config.measurement, state_->config.global_search);
  state_->search.cut();
  if (!state_->belief.empty()) state_->search.doubt(state_->search.prior(), "the map is new");
  state_->health.judge_anew();
}

bool Localizer::has_map() const { return !state_->fields.map.empty(); }
const DistanceMap& Localizer::map() const { return state_->fields.map; }
const LocalizerResult& Localizer::result() const { return state_->result; }
const ParticleSet& Localizer::particles() const { return state_->belief.particles(); }
bool Localizer::initialized() const { return !state_->belief.empty(); }
void Localizer::force_update() { state_->forced = true; }

void Localizer::initialize(const Pose2& T_map_base, const Eigen::Matrix3d& covariance, Trust trust) {
  State& s = *state_;
  s.belief.spread_around(T_map_base, covariance);
  s.T_filter_now = Pose2();
  s.search.doubt(trust == Trust::kGiven ? PoseSearch::Prior::kGiven : PoseSearch::Prior::kLocal,
                 trust == Trust::kGiven ? "a pose was given, to be confirmed" : "a saved pose is tried");
  s.health.clear();
  s.break_s.reset();
  s.lost = false;
  s.forced = true;
  s.given_pose_scans = trust == Trust::kGiven ? kGivenPoseScans : 0;
}

void Localizer::initialize_globally() {
  State& s = *state_;
  s.belief.clear();
  s.T_filter_now = Pose2();
  s.search.doubt(PoseSearch::Prior::kNone, "searching the map");
  s.health.clear();
  s.break_s.reset();
  s.lost = false;
}

void Localizer::reset() {
  State& s = *state_;
  initialize_globally();
  s.has_motion = s.has_odom = false;
  s.forced = true;
  s.result = LocalizerResult();
  s.result.reason = "no scan yet";
}

void Localizer::State::refuse(const char* why) {
  result.accepted = result.filter_updated = false;
  result.reason = why;
}

const LocalizerResult& Localizer::update(const RangeScan& scan, const Pose2& T_base_sensor,
                                         const Pose2& T_local_base, std::uint32_t epoch,
                                         const Pose2* T_odom_base) {
  State& s = *state_;
  if (!has_map()) {
    s.refuse("there is no map yet");
    return s.result;
  }
  if (!is_finite(T_local_base) || !is_finite(T_base_sensor) || !std::isfinite(scan.stamp_s)) {
    s.refuse("the motion estimate, the scanner's pose or the stamp is not finite");
    return s.result;
  }
  if (s.has_motion && scan.stamp_s < s.last_s) {
    s.refuse("the scan is older than the one before it");
    return s.result;
  }
  if (!select_rays(scan, T_base_sensor, s.config, s.scans, s.evidence_min(scan.stamp_s), s.evidence_power(), &s.rays)) {
    s.refuse("the scan has no rays, or its angles are not finite");
    return s.result;
  }
  ++s.scans;
  s.result.accepted = true;
  s.result.filter_updated = false;
  s.result.stamp_s = scan.stamp_s;
  s.take_motion(T_local_base, epoch, T_odom_base);
  s.last_s = scan.stamp_s;
  s.filter(scan.stamp_s);
  if (s.search.update(scan.stamp_s, s.fields, s.rays, s.T_filter_now, &s.belief)) {
    s.health.judge_anew();
    s.forced = true;
  }
  s.judge(scan.stamp_s);
  s.decide();
  return s.result;
}

void Localizer::State::take_motion(const Pose2& T_local_base, std::uint32_t new_epoch,
                                   const Pose2* T_odom_base) {
  if (!has_motion) {
    epoch = new_epoch;
  } else if (new_epoch != epoch && given_pose_scans > 0) {
    take_motion_after_given_pose(new_epoch);
  } else if (new_epoch != epoch) {
    begin_epoch(new_epoch, T_odom_base);
  } else {
    const Pose2 T_step = T_local_last.inverse() * T_local_base;
    T_filter_now = T_filter_now * T_step;
    T_tracked = T_tracked * T_step;
    search.move(T_step);
  }
  has_motion = true;
  if (given_pose_scans > 0) --given_pose_scans;
  T_local_last = T_local_base;
  has_odom = T_odom_base != nullptr && is_finite(*T_odom_base);
  if (has_odom) T_odom_last = *T_odom_base;
  result.motion_epoch = epoch;
}

void Localizer::State::begin_epoch(std::uint32_t new_epoch, const Pose2* T_odom_base) {
  epoch = new_epoch;
  break_s.reset();  // the local mapper has forgotten the old place, too
  search.cut();
  if (belief.empty()) return;
  if (has_odom && T_odom_base != nullptr && is_finite(*T_odom_base)) {
    T_filter_now = T_filter_now * (T_odom_last.inverse() * *T_odom_base);
  }
  belief.move(T_filter_now);
  T_filter_now = Pose2();
  belief.widen(config.epoch_spread_m, config.epoch_spread_rad);
  search.doubt(PoseSearch::Prior::kLocal, "the motion estimate began anew: carried, or reset");
  health.judge_anew();
  forced = true;
}

/// The local mapper begins anew where a pose is given, too; its first scan may come after some of the old ones. What was said
/// still holds.
void Localizer::State::take_motion_after_given_pose(std::uint32_t new_epoch) {
  epoch = new_epoch;
  given_pose_scans = 0;
  break_s.reset();
  search.cut();
  health.judge_anew();
  forced = true;
}

/// The view just now contradicts the map though the pose was tracked. People and moved furniture do that, and so does being
/// carried away, which the local mapper does not always notice: its scan then shows the old place in 303 of 360 degrees. Only
/// what is seen from now on can tell.
void Localizer::State::break_with_the_past() {
  constexpr double kNoticedAfter_s = 1.5;  // smoothing, and the time that the verdict takes
  if (break_s || belief.empty()) return;
  break_s = last_s - kNoticedAfter_s;
  T_tracked = pose_now();
}

double Localizer::State::evidence_min(double stamp_s) const {
  return break_s ? std::exp(-std::max(0.0, stamp_s - *break_s) / config.measurement.evidence_decay_s) : 0.0;
}

/// What was seen a while ago has had its say when it was seen, and has moved with the local map since. While the pose is in
/// doubt, it tells places apart all the same.
double Localizer::State::evidence_power() const {
  return search.in_doubt() ? config.measurement.evidence_power : config.measurement.evidence_power_tracked;
}

void Localizer::State::filter(double stamp_s) {
  if (belief.empty()) return;
  const double distance = std::hypot(T_filter_now.x_m, T_filter_now.y_m),
               turn = std::fabs(T_filter_now.yaw_rad);
  const double waited_s = std::max(0.0, stamp_s - filtered_s);
  if (!forced && distance < config.update_min_d && turn < config.update_min_a &&
      waited_s < config.update_max_s)
    return;
  belief.move(T_filter_now);
  T_filter_now = Pose2();
  if (rays.size() >= static_cast<std::size_t>(config.health.rays_min)) {
    // Thirty scans a second share most of their evidence: only what is new since the last weighing counts.
    const MeasurementConfig& m = config.measurement;
    const double novelty =
        distance / m.fresh_after_m + turn / m.fresh_after_rad + std::min(waited_s, 1.0) / m.fresh_after_s;
    belief.weigh(fields.fine, rays.points, m.temperature / std::clamp(novelty, 0.02, 1.0));
    result.filter_updated = true;
  }
  filtered_s = stamp_s;
  forced = false;
}

void Localizer::State::judge(double stamp_s) {
  result.has_pose = !belief.empty();
  check = PoseCheck();
  if (result.has_pose) {
    const BeliefEstimate& estimate = belief.estimate();
    result.T_map_base = pose_now();
    result.covariance = estimate.pose.covariance;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(result.covariance.topLeftCorner<2, 2>(),
                                                                Eigen::EigenvaluesOnly);
    result.position_sd_m = std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
    result.yaw_sd_rad = std::sqrt(std::max(0.0, result.covariance(2, 2)));
    check = check_pose(fields.map, rays, result.T_map_base, config.measurement, config.health, search.tracked());
    if (check.judged() >= static_cast<std::uint32_t>(config.health.rays_min)) {
      health.update(stamp_s, check);
    } else {
      health.pass(stamp_s);
    }
  }
  result.particles = static_cast<std::uint32_t>(belief.particles().size());
  result.support = health.support();
  result.fresh_support = health.fresh_support();
  result.inlier_fraction = check.inlier_fraction();
  result.explained_rays = check.explained;
  result.unexplained_rays = check.in_front + check.through;
  result.unknown_rays = check.unknown + static_cast<std::uint32_t>(rays.unknown);
}

void Localizer::State::decide() {
  using V = LocalizationVerdict;
  const auto say = [this](V verdict, std::string reason) {
    result.verdict = verdict;
    result.reason = std::move(reason);
  };
  if (belief.empty()) {
    if (search.searching())
      return say(V::kInitializing,
                 fmt::format("searching the map, {:.0f} % done", 100.0 * search.progress()));
    return say(V::kInitializing, config.global_search.enabled
                                     ? "waiting for a scan with enough rays to search the map with"
                                     : "waiting for an initial pose");
  }
  if (!search.in_doubt()) {
    lost = false;
    if (break_s && same_place(T_tracked, result.T_map_base)) break_s.reset();  // nobody has carried it
    if (!health.good() && (health.support() < config.health.ok_fraction ||
                           health.fresh_support() < config.health.fresh_ok_fraction)) {
      search.doubt(PoseSearch::Prior::kTracked, "");
      break_with_the_past();
    }
  } else if (search.prior() == PoseSearch::Prior::kGiven && health.good() && !config.global_search.enabled) {
    search.end_doubt();
  }
  if (health.lost() && !lost) {
    lost = true;
    // Before moved furniture as little may be explained as after a kidnap: where the robot was is still the best guess.
    const bool found_by_search = search.in_doubt() && search.prior() == PoseSearch::Prior::kNone;
    search.doubt(found_by_search ? PoseSearch::Prior::kNone : PoseSearch::Prior::kTracked, "lost");
    break_with_the_past();
  } else if (lost && health.good()) {
    lost = false;  // looking round showed more of what the map knows
  }
  if (lost) {
    return say(V::kLost,
               fmt::format("the map explains {:.0f} % of the scan, {:.0f} % of what is seen just now",
                           100.0 * health.support(), 100.0 * health.fresh_support()));
  }
  const BeliefEstimate& estimate = belief.estimate();
  if (!health.good()) {
    return say(V::kUncertain,
               fmt::format("the map explains only {:.0f} % of the scan, {:.0f} % of what is seen just now",
                           100.0 * health.support(), 100.0 * health.fresh_support()));
  }
  const bool given = search.prior() == PoseSearch::Prior::kGiven;
  if (search.in_doubt() && !given) return say(V::kUncertain, search.why());
  if (estimate.cluster_weight < config.health.ok_cluster_weight) {
    return say(V::kUncertain,
               fmt::format("the particles are in {} places", std::max<std::size_t>(2, estimate.clusters)));
  }
  if (result.position_sd_m > config.health.ok_position_sd_m ||
      result.yaw_sd_rad > config.health.ok_yaw_sd_rad) {
    return say(V::kUncertain, fmt::format("the particles are spread over {:.2f} m and {:.0f} deg (sd)",
                                          result.position_sd_m, result.yaw_sd_rad * 180.0 / kPi));
  }
  say(V::kOk, fmt::format("the map explains {:.0f} % of the scan", 100.0 * health.support()));
}

}  // namespace knav
