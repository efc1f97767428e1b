#include "tsdf_localizer/global_search.h"

#include <algorithm>
#include <cmath>


namespace knav {
namespace {

constexpr std::size_t kChunk = 1024;  ///< poses priced at once
constexpr std::size_t kFineRays = 180;
constexpr double kBin_m = 1.0;
constexpr int kSectors = 12;
constexpr double kSamePlace_m = 0.5, kSamePlace_rad = 0.3;

struct Level {
  bool coarse;
  double step_m, step_rad;
};
/// Halved from half of the first candidates' spacing to what the map's resolution is good for.
constexpr Level kLevels[] = {
    {true, 0.2, 0.044}, {false, 0.1, 0.022}, {false, 0.05, 0.011}, {false, 0.025, 0.0055}};

int sector_of(double yaw_rad) {
  const double turn = (normalize_angle_rad(yaw_rad) + kPi) / (2.0 * kPi);
  return std::min(kSectors - 1, static_cast<int>(turn * kSectors));
}

}  // namespace

bool same_place(const Pose2& a, const Pose2& b) {
  return distance_m(a, b) < kSamePlace_m &&
         std::fabs(normalize_angle_rad(a.yaw_rad - b.yaw_rad)) < kSamePlace_rad;
}

GlobalSearch::GlobalSearch(const GlobalSearchConfig& search, const MeasurementConfig& measurement,
                           const HealthConfig& health)
    : config_(search), measurement_(measurement), health_(health) {}

void GlobalSearch::start(const MapFields& fields, const ScanRays& rays, const std::vector<Pose2>& seeds,
                         bool seeds_tracked) {
  thin_out(rays, static_cast<std::size_t>(config_.coarse_rays), &coarse_rays_);
  thin_out(rays, kFineRays, &fine_rays_);
  headings_ = static_cast<std::size_t>(std::ceil(2.0 * kPi / config_.step_rad));
  pose_count_ = fields.search_positions.size() * headings_;
  next_pose_ = 0;
  const GridGeometry& grid = fields.map.geometry;
  bins_x_ = 1 + static_cast<int>(grid.width_cells * grid.resolution_m / kBin_m);
  bins_y_ = 1 + static_cast<int>(grid.height_cells * grid.resolution_m / kBin_m);
  best_of_bin_.assign(static_cast<std::size_t>(bins_x_) * static_cast<std::size_t>(bins_y_) * kSectors,
                      Best());
  candidates_.clear();
  hypotheses_.clear();
  seeds_.clear();
  for (const Pose2& seed : seeds) {
    if (!is_finite(seed)) continue;
    seeds_.push_back({seed, 1.0, 0.0, seeds_tracked});
    check(fields, &seeds_.back());
  }
  stage_ = Stage::kCoarse;
}

double GlobalSearch::progress() const {
  return pose_count_ > 0 ? static_cast<double>(next_pose_) / static_cast<double>(pose_count_) : 1.0;
}

bool GlobalSearch::step(const MapFields& fields) {
  const auto budget = static_cast<std::size_t>(config_.lookups_per_update);
  std::size_t used = 0;
  while (stage_ != Stage::kIdle && used < budget) {
    if (stage_ == Stage::kCoarse) {
      if (next_pose_ < pose_count_) {
        used += try_places(fields);
        continue;
      }
      choose_candidates(fields);
      next_candidate_ = 0;
      stage_ = Stage::kRefine;
    } else if (next_candidate_ < candidates_.size()) {
      used += refine(fields, &candidates_[next_candidate_++]);
    } else {
      rank();
      stage_ = Stage::kIdle;
      return true;
    }
  }
  return false;
}

std::size_t GlobalSearch::try_places(const MapFields& fields) {
  const std::size_t count = std::min(kChunk, pose_count_ - next_pose_);
  poses_.resize(count);
  for (std::size_t k = 0; k < count; ++k) {
    const Point2& p = fields.search_positions[(next_pose_ + k) / headings_];
    const auto heading = static_cast<double>((next_pose_ + k) % headings_);
    poses_.set(k, {p.x_m, p.y_m, normalize_angle_rad(2.0 * kPi * heading / static_cast<double>(headings_))});
  }
  mean_prices(fields.coarse, coarse_rays_.points, poses_, &cost_);
  const GridGeometry& grid = fields.map.geometry;
  for (std::size_t k = 0; k < count; ++k) {
    const auto bx = static_cast<std::size_t>((poses_.x_m[k] - grid.origin_x_m) / kBin_m);
    const auto by = static_cast<std::size_t>((poses_.y_m[k] - grid.origin_y_m) / kBin_m);
    const auto sector = static_cast<std::size_t>(sector_of(poses_.yaw_rad[k]));
    const std::size_t bin =
        std::min(best_of_bin_.size() - 1,
                 (by * static_cast<std::size_t>(bins_x_) + bx) * static_cast<std::size_t>(kSectors) + sector);
    if (cost_[k] < best_of_bin_[bin].cost) {
      best_of_bin_[bin] = {cost_[k], static_cast<float>(poses_.x_m[k]), static_cast<float>(poses_.y_m[k]),
                           static_cast<float>(poses_.yaw_rad[k])};
    }
  }
  next_pose_ += count;
  return count * coarse_rays_.size();
}

void GlobalSearch::choose_candidates(const MapFields& fields) {
  for (const Best& best : best_of_bin_) {
    if (best.cost <= 1.0f) candidates_.push_back({{best.x_m, best.y_m, best.yaw_rad}, best.cost, 0.0, false});
  }
  const auto better = [](const Hypothesis& a, const Hypothesis& b) { return a.cost < b.cost; };
  std::stable_sort(candidates_.begin(), candidates_.end(), better);
  if (candidates_.size() > static_cast<std::size_t>(config_.candidates)) {
    candidates_.resize(static_cast<std::size_t>(config_.candidates));
  }
  for (const Hypothesis& seed : seeds_) {
    if (seed.tracked || fields.map.nearest(seed.T_map_base.x_m, seed.T_map_base.y_m) > 0.0f) candidates_.push_back(seed);
  }
}

void GlobalSearch::check(const MapFields& fields, Hypothesis* hypothesis) const {
  const Pose2& T = hypothesis->T_map_base;
  const PoseCheck check = check_pose(fields.map, fine_rays_, T, measurement_, health_, hypothesis->tracked);
  const bool no_place = !hypothesis->tracked && !(fields.map.nearest(T.x_m, T.y_m) > 0.0f);  // inside a wall
  hypothesis->cost = no_place ? 1.0 : check.cost;
  hypothesis->support = check.support;
  hypothesis->explained = check.explained;
}

std::size_t GlobalSearch::refine(const MapFields& fields, Hypothesis* hypothesis) {
  std::size_t lookups = 0;
  Pose2 best = hypothesis->T_map_base;
  for (const Level& level : kLevels) {
    for (int round = 0; round < 2; ++round) {
      poses_.resize(27);
      std::size_t k = 0;
      for (const int dx : {0, -1, 1}) {  // the centre first: it wins ties
        for (const int dy : {0, -1, 1}) {
          for (const int dyaw : {0, -1, 1}) {
            poses_.set(k++, {best.x_m + dx * level.step_m, best.y_m + dy * level.step_m,
                             best.yaw_rad + dyaw * level.step_rad});
          }
        }
      }
      mean_prices(level.coarse ? fields.coarse : fields.fine, fine_rays_.points, poses_, &cost_);
      lookups += 27 * fine_rays_.size();
      const auto winner =
          static_cast<std::size_t>(std::min_element(cost_.begin(), cost_.end()) - cost_.begin());
      if (winner == 0) break;
      best = poses_.pose(winner);
    }
  }
  best.yaw_rad = normalize_angle_rad(best.yaw_rad);
  hypothesis->T_map_base = best;
  check(fields, hypothesis);
  return lookups + 10 * fine_rays_.size();
}

void GlobalSearch::rank() {
  std::stable_sort(candidates_.begin(), candidates_.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.cost < b.cost; });
  for (const Hypothesis& candidate : candidates_) {
    if (hypotheses_.size() >= static_cast<std::size_t>(config_.hypotheses)) break;
    const bool known = std::any_of(hypotheses_.begin(), hypotheses_.end(), [&](const Hypothesis& h) {
      return same_place(h.T_map_base, candidate.T_map_base);
    });
    if (!known && candidate.cost < 1.0) hypotheses_.push_back(candidate);
  }
}

}  // namespace knav
