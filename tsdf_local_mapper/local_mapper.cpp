#include "tsdf_local_mapper/local_mapper.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "core/config.h"
#include "core/contour.h"
#include "tsdf_local_mapper/close_obstacles.h"
#include "tsdf_local_mapper/local_map.h"
#include "tsdf_local_mapper/odometry_bound.h"
#include "tsdf_local_mapper/odometry_stream.h"
#include "tsdf_local_mapper/pose_filter.h"
#include "tsdf_local_mapper/range_errors.h"
#include "tsdf_local_mapper/reading_selection.h"
#include "tsdf_local_mapper/sliding_window.h"
#include "tsdf_local_mapper/view_check.h"

namespace knav {
namespace {

constexpr int kFewestReadings = 10;
constexpr double kParkedAfter_s = 0.5, kParkedWithin_m = 0.005, kParkedWithin_rad = 0.004;

const LocalMapperConfig& checked(const LocalMapperConfig& config) {
  const auto faults = config.validate();
  if (!faults.empty()) throw_faults(faults);
  return config;
}

ObservationLimits limits_of(const LocalMapperConfig& config) {
  return {config.range_min_m, config.range_max_m, config.scan_free_beyond_m, config.tsdf.clear_margin_m,
          config.tsdf.truncation};
}

}  // namespace

struct LocalMapper::State {
  explicit State(const LocalMapperConfig& c)
      : config(c),
        limits(limits_of(c)),
        grid(c.tsdf, c.grid_half_size_m),
        window(c.window),
        filter(c.filter, c.motion, c.odometry_errors, c.odometry_timing, static_cast<std::uint64_t>(c.seed)),
        readings(c.filter, c.motion),
        odometry_bound(c.odometry_bound, c.motion),
        view_check(c.continuity, c.contour, c.range_max_m),
        close_obstacles(c.close_obstacles),
        range_errors(c.range_errors, c.tsdf),
        odometry(c.continuity) {}

  void new_epoch(EpochReason why, const std::string& text);
  void forget_pose();
  void note_motion(double stamp_s);
  double evidence_of(double dt_s) const;
  template <class Frame>
  void observe(const Frame& frame);
  void align(const Pose2& T_step, const Pose2& T_base_sensor, double dt_s);
  void integrate(const Pose2& T_base_sensor);
  const LocalMapperResult& reject(FrameOutcome outcome, double stamp_s, const std::string& reason);
  template <class Frame>
  const LocalMapperResult& update(const Frame& frame, bool sensible, const Pose2& T_base_sensor);

  LocalMapperConfig config;
  ObservationLimits limits;
  TsdfGrid grid;
  SlidingWindow window;
  PoseFilter filter;
  ReadingSelection readings;
  OdometryBound odometry_bound;
  ViewCheck view_check;
  CloseObstacles close_obstacles;
  RangeErrors range_errors;
  DepthProfile corrected;
  OdometryStream odometry;

  bool have_frame = false;  ///< stamp_s, T_odom_base and T_local_base of `result` mean something
  bool have_map = false;
  bool newest_integrated = false;
  bool in_doubt = false;  ///< the localizer is
  bool any_epoch = false;
  double clock_s = 0.0;  ///< the window's clock
  double travelled_m = 0.0;
  Pose2 rest_T_odom_base;  ///< where the robot last was when it moved
  double moved_stamp_s = 0.0;
  bool parked = false;
  std::string news;                   ///< of an epoch, until an accepted frame has told it
  LocalMapperResult result;
  LocalMapperResult rejected;
};

const LocalMapperResult& LocalMapper::State::reject(FrameOutcome outcome, double stamp_s,
                                                    const std::string& reason) {
  rejected = result;
  rejected.accepted = false;
  rejected.outcome = outcome;
  rejected.stamp_s = stamp_s;
  rejected.reason = reason;
  return rejected;
}

void LocalMapper::State::new_epoch(EpochReason why, const std::string& text) {
  grid.clear();
  window.clear();
  range_errors.new_map();
  have_map = false;
  view_check.reset();
  close_obstacles.reset();
  odometry_bound.reset();
  if (any_epoch) ++result.epoch;
  any_epoch = true;
  result.epoch_reason = why;
  news = text;
}

void LocalMapper::State::forget_pose() {
  have_frame = false;
  result.T_local_base = Pose2{};
  result.covariance.setZero();
  clock_s = travelled_m = 0.0;
  parked = false;
}

void LocalMapper::State::note_motion(double stamp_s) {
  const Pose2& now = result.T_odom_base;
  if (distance_m(rest_T_odom_base, now) > kParkedWithin_m ||
      std::fabs(normalize_angle_rad(now.yaw_rad - rest_T_odom_base.yaw_rad)) > kParkedWithin_rad) {
    rest_T_odom_base = now;
    moved_stamp_s = stamp_s;
  }
  parked = stamp_s - moved_stamp_s > kParkedAfter_s;
}

/// How much of a frame's evidence is new. A Kinect's bands, blobs of noise and wrong scale stay for many
/// frames; taken for new evidence thirty times a second they pull the estimate after them.
double LocalMapper::State::evidence_of(double dt_s) const {
  if (config.filter.evidence_period_s <= 0.0 || config.filter.alignment_cost == "paper") return 1.0;
  return std::clamp(dt_s / config.filter.evidence_period_s, 0.02, 1.0);
}

/// The frame as the window's next observation.
template <class Frame>
void LocalMapper::State::observe(const Frame& frame) {
  if constexpr (std::is_same_v<Frame, DepthProfile>) {
    if (range_errors.on()) {
      corrected = frame;
      range_errors.correct(window.next_sequence(), &corrected);
      observation_from(corrected, limits, &window.scratch());
      return;
    }
  }
  observation_from(frame, limits, &window.scratch());
}

void LocalMapper::State::integrate(const Pose2& T_base_sensor) {
  window.scratch().T_map_sensor = result.T_local_base * T_base_sensor;
  grid.scroll_to(result.T_local_base.x_m, result.T_local_base.y_m, window.next_sequence());
  window.expire(&grid, clock_s, travelled_m, in_doubt);
  window.push(&grid, clock_s, travelled_m, parked && config.window.clock == "moving");
  if (range_errors.on()) range_errors.learn(window, travelled_m, grid, config.contour);
}

void LocalMapper::State::align(const Pose2& T_step, const Pose2& T_base_sensor, double dt_s) {
  const TsdfObservation& observation = window.scratch();
  WeightedPoints& points =
      readings.select(observation, T_base_sensor, grid, window.next_sequence(), result.T_local_base, T_step, dt_s);
  const bool enough = points.size() >= static_cast<std::size_t>(kFewestReadings);
  result.outcome = enough ? FrameOutcome::kAligned : FrameOutcome::kNoReadings;
  if (!have_map) {
    filter.shift(T_step);
    have_map = enough;
    if (enough) result.outcome = FrameOutcome::kStarted;
  } else if (parked) {
    filter.shift(T_step);
    result.outcome = FrameOutcome::kParked;
  } else {
    filter.predict(T_step, dt_s);
    if (enough) {
      filter.update(grid, &points, result.stamp_s, evidence_of(dt_s));
    } else {
      filter.estimate_from_particles();
    }
  }
  Pose2 T_local_base = filter.mean();
  MotionNoise odometry_sd;
  const bool drawn = odometry_bound.bound(result.stamp_s, result.T_odom_base, readings.coverage(), &T_local_base, &odometry_sd);
  if (drawn) filter.shift(filter.mean().inverse() * T_local_base);
  result.T_local_base = filter.mean();
  result.covariance = filter.covariance();
  if (drawn) {
    // The particles agree on what is not believed.
    result.covariance.diagonal() += Eigen::Vector3d(odometry_sd.forward_m, odometry_sd.sideways_m, odometry_sd.turn_rad).cwiseAbs2();
  }
  result.covariance.diagonal() += Eigen::Vector3d(1e-6, 1e-6, 1e-6);  // what a cell's 8 bits resolve
  if (!enough || result.outcome == FrameOutcome::kStarted) return;
  view_check.update(grid, observation, result.T_local_base * T_base_sensor, dt_s);
  if (view_check.carried()) {
    new_epoch(EpochReason::kCarried, "the robot was carried: it sees nothing that it knew");
    filter.start_at(result.T_local_base, result.stamp_s);
    have_map = true;
    result.outcome = FrameOutcome::kStarted;
  } else if (view_check.suspicious()) {
    result.outcome = FrameOutcome::kSuspicious;
  }
}

template <class Frame>
const LocalMapperResult& LocalMapper::State::update(const Frame& frame, bool sensible,
                                                    const Pose2& T_base_sensor) {
  const double stamp_s = frame.stamp_s;
  if (!sensible || !std::isfinite(stamp_s) || !is_finite(T_base_sensor)) {
    return reject(FrameOutcome::kBadFrame, stamp_s,
                  "the frame has no columns, or a stamp or model that makes no sense");
  }
  if (have_frame && stamp_s <= result.stamp_s) {
    if (stamp_s == result.stamp_s)
      return reject(FrameOutcome::kDuplicate, stamp_s, "this stamp was seen before");
    if (result.stamp_s - stamp_s <= config.continuity.clock_jump_s) {
      return reject(FrameOutcome::kOutOfOrder, stamp_s, "older than the newest frame");
    }
    const std::string text =
        fmt::format("the clock jumped back by {:.1f} s; map and pose start anew", result.stamp_s - stamp_s);
    odometry.clock_jumped_back_to(stamp_s);
    new_epoch(EpochReason::kClockJump, text);
    forget_pose();
  }
  Pose2 T_odom_base;
  switch (odometry.at(stamp_s, &T_odom_base)) {
    case PoseBuffer::Lookup::kOk:
      break;
    case PoseBuffer::Lookup::kEmpty:
    case PoseBuffer::Lookup::kTooNew:
      return reject(FrameOutcome::kWaitForOdometry, stamp_s, "odometry does not cover the frame's stamp yet");
    case PoseBuffer::Lookup::kTooOld:
      return reject(FrameOutcome::kNoOdometry, stamp_s, "odometry does not reach back to the frame's stamp");
    case PoseBuffer::Lookup::kGap:
      return reject(FrameOutcome::kNoOdometry, stamp_s, "odometry has a gap at the frame's stamp");
  }
  if (!any_epoch) new_epoch(EpochReason::kStart, "");
  const OdometryStream::Break odometry_break = odometry.take_break();
  if (have_frame && odometry_break != OdometryStream::Break::kNone) {
    const bool gap = odometry_break == OdometryStream::Break::kGap;
    new_epoch(gap ? EpochReason::kOdometryGap : EpochReason::kOdometryJump,
              gap ? "odometry was silent; nothing links the poses before and after"
                  : "odometry jumped; nothing links the poses before and after");
    result.T_odom_base = T_odom_base;  // no step
  }

  const Pose2 T_step = have_frame ? result.T_odom_base.inverse() * T_odom_base : Pose2{};
  const double dt = have_frame ? stamp_s - result.stamp_s : 0.0;
  result.stamp_s = stamp_s;
  result.T_odom_base = T_odom_base;
  if (!have_frame) {
    rest_T_odom_base = T_odom_base;
    moved_stamp_s = stamp_s;
    filter.start_at(result.T_local_base, stamp_s);
  }
  have_frame = true;
  note_motion(stamp_s);
  travelled_m += std::hypot(T_step.x_m, T_step.y_m);
  if (!parked || config.window.clock == "paper") clock_s += dt;

  observe(frame);
  align(T_step, T_base_sensor, dt);
  newest_integrated = result.outcome != FrameOutcome::kSuspicious;
  if (newest_integrated) integrate(T_base_sensor);
  if constexpr (std::is_same_v<Frame, DepthProfile>) {
    close_obstacles.update(frame, result.T_local_base * T_base_sensor, grid);
  }

  result.accepted = true;
  result.reason = std::move(news);
  news.clear();
  result.cost = filter.mean_cost();
  result.effective_particles = filter.effective_particles();
  result.particle_lifespan_s = filter.lifespan_s();
  result.agree_fraction = view_check.agree_fraction();
  result.see_through_fraction = view_check.see_through_fraction();
  result.observations = window.size();
  return result;
}

LocalMapper::LocalMapper(const LocalMapperConfig& config)
    : state_(std::make_unique<State>(checked(config))) {}
LocalMapper::~LocalMapper() = default;

void LocalMapper::add_odometry(double stamp_s, const Pose2& T_odom_base) {
  state_->odometry.add(stamp_s, T_odom_base);
}

const LocalMapperResult& LocalMapper::update(const DepthProfile& profile, const Pose2& T_base_camera) {
  const std::size_t columns = profile.z_m.size();
  const bool sensible = columns > 0 && profile.free_from_m.size() == columns &&
                        profile.free_to_m.size() == columns && profile.fx_px > 0.0 &&
                        std::isfinite(profile.fx_px) && std::isfinite(profile.cx_px);
  return state_->update(profile, sensible, T_base_camera);
}

const LocalMapperResult& LocalMapper::update(const RangeScan& scan, const Pose2& T_base_sensor) {
  const double turn = std::fabs(scan.angle_increment_rad) * static_cast<double>(scan.range_m.size());
  const bool sensible =
      !scan.range_m.empty() && std::isfinite(scan.angle_min_rad) && turn > 0.0 && turn < 6.5;
  return state_->update(scan, sensible, T_base_sensor);
}

void LocalMapper::set_in_doubt(bool in_doubt) { state_->in_doubt = in_doubt; }

void LocalMapper::extract_scan_360(RangeScan* scan) const {
  const State& s = *state_;
  extract_contour(s.grid, s.config.contour, s.result.T_local_base, static_cast<float>(s.clock_s), scan);
  scan->stamp_s = s.result.stamp_s;
  if (s.config.contour.merge_newest && s.window.size() > 0 && s.newest_integrated) {
    merge_newest(s.window.at(s.window.size() - 1), s.result.T_local_base, scan);
  }
  s.close_obstacles.add_to(s.result.T_local_base, scan);
}

void LocalMapper::extract_local_map(OccupancyGrid* map) const {
  const State& s = *state_;
  extract_occupancy(s.grid, s.result.T_local_base.x_m, s.result.T_local_base.y_m, s.config.local_map_size_m,
                    SurfaceRule(s.config.contour.surface_within), map);
  s.close_obstacles.add_to(map);
}

void LocalMapper::reset() {
  state_->new_epoch(EpochReason::kReset, "reset on request; map and pose start anew");
  state_->forget_pose();
  state_->odometry.clear();
}

const LocalMapperConfig& LocalMapper::config() const { return state_->config; }
const LocalMapperResult& LocalMapper::result() const { return state_->result; }
const TsdfGrid& LocalMapper::grid() const { return state_->grid; }
RangeOffsets LocalMapper::range_offsets() const { return state_->range_errors.offsets(); }
void LocalMapper::start_from(const RangeOffsets& offsets) { state_->range_errors.start_from(offsets); }
const ParticleSet& LocalMapper::particles() const { return state_->filter.particles(); }

}  // namespace knav
