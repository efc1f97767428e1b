#include "tsdf_local_mapper/range_errors.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace knav {
namespace {
constexpr double kSeenAgain_m = 10.0;  ///< driven since, so that what was far has been near
constexpr double kEvery_m = 0.3, kEvery_rad = 0.15;
constexpr int kLookStride = 10;  ///< every so manieth observation in the map is asked whether it saw the place
constexpr std::size_t kSurfaceColumns = 6;
constexpr double kNearest_m = 2.0, kMinSine = 0.5;
constexpr double kNearestLook_m = 0.5, kViewSlope = 0.5;  ///< what a Kinect sees: 27 degrees to either side
constexpr double kGate_m = 0.1, kGateShare = 0.03;  ///< farther from the map's surface: another surface
constexpr double kNoise_m = 0.02, kNoisePerSquare = 0.0015;
constexpr double kPoseSd_m = 0.1, kPoseSd_rad = 0.02;
constexpr int kFewestReadings = 8;
constexpr double kMeanSdShare = 0.01;  ///< the bands' mean is as good as zero: of offset_sd_per_m
}  // namespace

/// A reading of an old observation against the map as it is now: error_m = gain * offset + pose . (pose's error) + noise.
struct RangeErrors::Reading {
  double error_m, gain, sd_m;
  Eigen::Vector3d pose;
};

RangeErrors::RangeErrors(const RangeErrorsConfig& config, const TsdfConfig& tsdf)
    : config_(config), tsdf_(tsdf), solver_(config.bands) {
  const int n = config.bands;
  const double each = 1.0 / (config.offset_sd_per_m * config.offset_sd_per_m);
  const double mean = 1.0 / (kMeanSdShare * kMeanSdShare) * each;
  prior_ = Eigen::MatrixXd::Identity(n, n) * each + Eigen::MatrixXd::Constant(n, n, mean / (n * n));
  information_ = prior_;
  evidence_ = offset_ = frame_evidence_ = Eigen::VectorXd::Zero(n);
  frame_information_ = Eigen::MatrixXd::Zero(n, n);
  common_ = Eigen::MatrixXd::Zero(n, 3);
  common_gain_ = Eigen::MatrixXd::Zero(3, n);
}

void RangeErrors::start_from(const RangeOffsets& offsets) {
  const auto from = static_cast<int>(offsets.offset_per_m.size());
  if (from < 2 || offsets.sd_per_m.size() != offsets.offset_per_m.size()) {
    throw UserError("learned range errors: there must be as many deviations as offsets, at least two.");
  }
  information_ = prior_;
  for (int band = 0; band < config_.bands; ++band) {
    const double at = (band + 0.5) * from / config_.bands - 0.5;
    const int i = std::clamp(static_cast<int>(std::floor(at)), 0, from - 2);
    const double share = std::clamp(at - i, 0.0, 1.0);
    const auto k = static_cast<std::size_t>(i);
    offset_[band] = (1.0 - share) * offsets.offset_per_m[k] + share * offsets.offset_per_m[k + 1];
    const double sd = (1.0 - share) * offsets.sd_per_m[k] + share * offsets.sd_per_m[k + 1];
    information_(band, band) = std::max(prior_(band, band), prior_(0, 1) + 1.0 / (sd * sd));
  }
  offset_.array() -= offset_.mean();
  evidence_.noalias() = information_ * offset_;
  changed_ = true;
}

void RangeErrors::new_map() {
  versions_.clear();
  changed_ = true;
  any_ = false;
}

RangeErrors::Place RangeErrors::place_of(std::size_t column, std::size_t columns) const {
  const double at = (static_cast<double>(column) + 0.5) * config_.bands / static_cast<double>(columns) - 0.5;
  const int band = std::clamp(static_cast<int>(std::floor(at)), 0, config_.bands - 2);
  return {band, std::clamp(at - band, 0.0, 1.0)};
}

double RangeErrors::offset_at(const Eigen::VectorXd& offset, std::size_t column, std::size_t columns) const {
  const Place p = place_of(column, columns);
  return (1.0 - p.share) * offset[p.band] + p.share * offset[p.band + 1];
}

void RangeErrors::correct(std::uint32_t sequence, DepthProfile* profile) {
  if (changed_) versions_.push_back({sequence, offset_});
  changed_ = false;
  const std::size_t n = profile->z_m.size();
  for (std::size_t i = 0; i < n; ++i) {
    const auto offset = static_cast<float>(offset_at(offset_, i, n));
    for (std::vector<float>* field : {&profile->z_m, &profile->free_from_m, &profile->free_to_m}) {
      (*field)[i] /= 1.0f + offset * (*field)[i];
    }
  }
}

const Eigen::VectorXd& RangeErrors::offset_then(std::uint32_t sequence) {
  while (versions_.size() > 1 && versions_[1].first_sequence <= sequence) versions_.pop_front();
  return versions_.empty() ? offset_ : versions_.front().offset;
}

bool RangeErrors::due(const Pose2& T) const {
  return !any_ || std::hypot(T.x_m - T_map_sensor_.x_m, T.y_m - T_map_sensor_.y_m) >= kEvery_m ||
         std::fabs(normalize_angle_rad(T.yaw_rad - T_map_sensor_.yaw_rad)) >= kEvery_rad;
}

void RangeErrors::learn(const SlidingWindow& window, double travelled_m, const TsdfGrid& grid,
                        const ContourConfig& contour) {
  for (int i = window.first_after(learned_); i < window.size(); ++i) {
    if (travelled_m - window.travelled_m(i) < kSeenAgain_m) break;
    const TsdfObservation& observation = window.at(i);
    learned_ = observation.sequence;
    if (!observation.pinhole || !due(observation.T_map_sensor)) continue;
    looks_.clear();
    for (int k = i % kLookStride; k < window.size(); k += kLookStride) looks_.push_back(window.at(k).T_map_sensor);
    learn_from(observation, grid, contour);
  }
}

/// The mean squared range from which the map's observations look at a place, each by its say in where the map has the
/// surface: its weight (equation 4) over its truncation, the slope of F. NaN if none does.
double RangeErrors::squared_range_of_looks(double x_m, double y_m) const {
  double sum = 0.0, total = 0.0;
  for (const Pose2& T : looks_) {
    const double dx = x_m - T.x_m, dy = y_m - T.y_m;
    const double c = std::cos(T.yaw_rad), s = std::sin(T.yaw_rad), forward = c * dx + s * dy, left = c * dy - s * dx;
    if (forward < kNearestLook_m || std::fabs(left) > kViewSlope * forward) continue;
    const double square = dx * dx + dy * dy, d = std::max(std::sqrt(square), tsdf_.weight_range_floor_m);
    const double say = 1.0 / (d * d * static_cast<double>(tsdf_.truncation.at(static_cast<float>(d))));
    sum += say * square;
    total += say;
  }
  return sum / total;
}

bool RangeErrors::compare(const TsdfObservation& o, std::size_t column, const Eigen::VectorXd& then, const TsdfGrid& grid,
                          const ContourConfig& contour, Reading* reading) const {
  const double r = o.range_m[column];
  if (!(r >= kNearest_m) || column < kSurfaceColumns || column + kSurfaceColumns >= o.columns()) return false;
  const std::size_t left = column - kSurfaceColumns, right = column + kSurfaceColumns;
  const double tx = o.direction_x[right] * o.range_m[right] - o.direction_x[left] * o.range_m[left];
  const double ty = o.direction_y[right] * o.range_m[right] - o.direction_y[left] * o.range_m[left];
  const double length = std::hypot(tx, ty);
  if (!(length > 0.0)) return false;  // a neighbour without a reading
  if (o.cut(column)) return false;
  const double dx = o.direction_x[column], dy = o.direction_y[column];
  const double nx = -ty / length, ny = tx / length, square = nx * dx + ny * dy;
  if (std::fabs(square) < kMinSine) return false;
  const Pose2& T = o.T_map_sensor;
  const double c = std::cos(T.yaw_rad), s = std::sin(T.yaw_rad);
  const double wx = c * dx - s * dy, wy = s * dx + c * dy;
  const RayEnd end = cast_ray(grid, contour, T.x_m, T.y_m, wx, wy, r + 1.0);
  if (end.kind != RayEnd::Kind::kSurface) return false;
  const double error = r - end.range_m;
  if (std::fabs(error) > kGate_m + kGateShare * r) return false;
  // The map has the place wrong too, but by the errors of other columns: a place that does not lie straight ahead wanders
  // across the image as the robot comes nearer.
  const double looks = squared_range_of_looks(T.x_m + wx * end.range_m, T.y_m + wy * end.range_m);
  if (!(looks < r * r)) return false;
  const double z = r * dx, raw_z = z / (1.0 - offset_at(then, column, o.columns()) * z);
  reading->error_m = error + (raw_z - z) / dx;
  reading->gain = raw_z * raw_z / dx;
  reading->sd_m = std::hypot(kNoise_m + kNoisePerSquare * r * r, config_.offset_sd_per_m * looks);
  reading->pose = Eigen::Vector3d(-nx, -ny, (nx * dy - ny * dx) * r) / square;
  return true;
}

void RangeErrors::forget_some(double moved_m) {
  const double keep = std::exp(-moved_m / config_.memory_m);
  information_ = keep * information_ + (1.0 - keep) * prior_;
  evidence_ *= keep;
}

void RangeErrors::learn_from(const TsdfObservation& o, const TsdfGrid& grid, const ContourConfig& contour) {
  if (any_) forget_some(std::hypot(o.T_map_sensor.x_m - T_map_sensor_.x_m, o.T_map_sensor.y_m - T_map_sensor_.y_m));
  T_map_sensor_ = o.T_map_sensor;
  any_ = true;
  frame_information_.setZero();
  frame_evidence_.setZero();
  common_.setZero();
  Eigen::Matrix3d pose_information =
      Eigen::Vector3d(1.0 / (kPoseSd_m * kPoseSd_m), 1.0 / (kPoseSd_m * kPoseSd_m), 1.0 / (kPoseSd_rad * kPoseSd_rad))
          .asDiagonal();
  Eigen::Vector3d pose_evidence = Eigen::Vector3d::Zero();
  const Eigen::VectorXd& then = offset_then(o.sequence);
  const std::size_t stride = std::max<std::size_t>(1, o.columns() / (2 * static_cast<std::size_t>(config_.bands)));
  int used = 0;
  for (std::size_t column = stride / 2; column < o.columns(); column += stride) {
    Reading reading;
    if (!compare(o, column, then, grid, contour, &reading)) continue;
    const double w = 1.0 / (reading.sd_m * reading.sd_m);
    const Place place = place_of(column, o.columns());
    const double gain[2] = {reading.gain * (1.0 - place.share), reading.gain * place.share};
    for (int a = 0; a < 2; ++a) {
      for (int b = 0; b < 2; ++b) frame_information_(place.band + a, place.band + b) += w * gain[a] * gain[b];
      common_.row(place.band + a) += w * gain[a] * reading.pose.transpose();
      frame_evidence_[place.band + a] += w * gain[a] * reading.error_m;
    }
    pose_information += w * reading.pose * reading.pose.transpose();
    pose_evidence += w * reading.pose * reading.error_m;
    ++used;
  }
  if (used < kFewestReadings) return;
  // The Schur complement of the pose's error.
  common_gain_ = pose_information.llt().solve(common_.transpose());
  frame_information_.noalias() -= common_ * common_gain_;
  information_ += frame_information_;
  evidence_ += frame_evidence_;
  evidence_.noalias() -= common_gain_.transpose() * pose_evidence;
  solver_.compute(information_);
  offset_ = solver_.solve(evidence_);
  changed_ = true;
}

RangeOffsets RangeErrors::offsets() const {
  const Eigen::MatrixXd covariance = information_.llt().solve(Eigen::MatrixXd::Identity(config_.bands, config_.bands));
  RangeOffsets out;
  for (int band = 0; band < config_.bands; ++band) {
    out.offset_per_m.push_back(offset_[band]);
    out.sd_per_m.push_back(std::sqrt(covariance(band, band)));
  }
  return out;
}

}  // namespace knav
