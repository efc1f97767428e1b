#include "tsdf_localizer/pose_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace knav {

PoseSearch::PoseSearch(const LocalizerConfig& config)
    : config_(config), search_(config.global_search, config.measurement, config.health) {}

void PoseSearch::doubt(Prior prior, const std::string& why) {
  in_doubt_ = true;
  prior_ = prior;
  why_ = why;
  agreements_ = defeats_ = same_rival_ = 0;
  any_search_ = false;
  search_.cancel();
}

void PoseSearch::cut() {
  same_rival_ = 0;
  search_.cancel();
  any_search_ = false;
}

void PoseSearch::move(const Pose2& T_before_after) {
  T_start_now_ = T_start_now_ * T_before_after;
  T_rival_ = T_rival_ * T_before_after;
  rival_m_ += std::hypot(T_before_after.x_m, T_before_after.y_m);
  rival_rad_ += std::fabs(T_before_after.yaw_rad);
  distance_m_ += std::hypot(T_before_after.x_m, T_before_after.y_m);
  turn_rad_ += std::fabs(T_before_after.yaw_rad);
}

bool PoseSearch::due(double stamp_s) const {
  const GlobalSearchConfig& c = config_.global_search;
  return !any_search_ || distance_m_ >= c.repeat_after_m || turn_rad_ >= c.repeat_after_rad ||
         stamp_s - started_s_ >= c.repeat_after_s || stamp_s < started_s_;
}

bool PoseSearch::update(double stamp_s, const MapFields& fields, const ScanRays& rays,
                        const Pose2& T_filter_now, Belief* belief) {
  if (!config_.global_search.enabled || !in_doubt_) return false;
  if (!search_.running()) {
    if (!due(stamp_s) || rays.size() < static_cast<std::size_t>(config_.health.rays_min)) return false;
    std::vector<Pose2> seeds;
    if (!belief->empty()) seeds.push_back(belief->estimate().pose.mean * T_filter_now);
    search_.start(fields, rays, seeds, tracked());
    T_start_now_ = Pose2();
    distance_m_ = turn_rad_ = 0.0;
    started_s_ = stamp_s;
    any_search_ = true;
  }
  return search_.step(fields) && judge(fields, T_filter_now, belief);
}

/// A place that only happens to look right does not look right from the next place as well. Seen from one and the same place,
/// it always does.
bool PoseSearch::unseats_tracked(const Pose2& T_rival_filter, const Pose2& T_filter_now, bool alone) {
  const GlobalSearchConfig& c = config_.global_search;
  const Pose2 T_rival = T_rival_filter * T_filter_now;
  if (same_rival_ == 0 || !same_place(T_rival, T_rival_)) {
    same_rival_ = same_alone_ = 0;
  } else if (rival_m_ < c.repeat_after_m && rival_rad_ < c.repeat_after_rad) {
    return false;
  }
  ++same_rival_;
  same_alone_ += alone;
  T_rival_ = T_rival;
  rival_m_ = rival_rad_ = 0.0;
  return same_rival_ >= c.unseat_after || same_alone_ >= c.unseat_alone_after;
}

bool PoseSearch::judge(const MapFields& fields, const Pose2& T_filter_now, Belief* belief) {
  if (search_.hypotheses().empty()) {
    why_ = "no place of the map fits the scan";
    agreements_ = 0;
    return false;
  }
  const double margin = config_.global_search.ambiguity_margin;
  const double best_cost = search_.hypotheses().front().cost;
  now_.clear();
  for (const Hypothesis& h : search_.hypotheses()) {
    if (h.cost > best_cost + 2.0 * margin && !now_.empty()) break;
    now_.push_back(h);
    now_.back().T_map_base = h.T_map_base * T_start_now_ * T_filter_now.inverse();
  }
  const double temperature = 0.5 * margin + 1e-6;
  if (belief->empty()) {
    belief->inject(now_, 1.0, temperature);
    why_ = now_.size() > 1 ? fmt::format("{} places fit the scan", now_.size())
                           : "found by search, to be confirmed";
    return true;
  }
  const Pose2 estimate = belief->estimate().pose.mean;
  const Hypothesis* mine = nullptr;
  const Hypothesis* rival = nullptr;
  int as_good = 0;
  for (const Hypothesis& h : search_.hypotheses()) {
    const Pose2 T = h.T_map_base * T_start_now_ * T_filter_now.inverse();
    if (same_place(T, estimate)) {
      if (!mine) mine = &h;
    } else {
      if (!rival) rival = &h;
      as_good += h.cost <= best_cost + margin;
    }
  }
  // Where many places are better, or one half a metre off, it is none of the hypotheses; it has its price all the same.
  if (!mine && !search_.seeds().empty() && same_place(search_.seeds().front().T_map_base * T_start_now_ * T_filter_now.inverse(), estimate)) {
    mine = &search_.seeds().front();
  }
  const double my_cost = mine ? mine->cost : 1.0, rival_cost = rival ? rival->cost : 1.0;
  const double lead = rival_cost - my_cost;
  const double needed = prior_ == Prior::kNone ? margin : prior_ == Prior::kGiven ? -margin : margin / 3.0;
  if (mine && lead >= needed) {
    defeats_ = 0;
    if (mine->support < config_.health.ok_fraction) {
      agreements_ = 0;
      why_ = fmt::format("the best place found explains only {:.0f} % of the scan", 100.0 * mine->support);
      return false;
    }
    const bool known_before = prior_ != Prior::kNone;
    const GlobalSearchConfig& c = config_.global_search;
    if (++agreements_ >= (known_before ? c.confirm_after : c.confirm_anew_after) || (known_before && lead > 3.0 * margin)) {
      in_doubt_ = false;
    } else {
      why_ = "the place fits, to be confirmed";
    }
    return false;
  }
  agreements_ = 0;
  if (mine && lead >= 0.0) {
    defeats_ = same_rival_ = 0;
    why_ = fmt::format("{} other place(s) of the map fit the scan as well", as_good);
    return false;
  }
  // Another place is better. A little: let the filter decide. Clearly, and twice: move there.
  const bool clearly = lead < -margin;
  if (prior_ == Prior::kTracked) {
    why_ = "another place of the map fits the scan better, so far";
    if (!clearly || rival == nullptr) {
      same_rival_ = 0;
      return false;
    }
    // By share of what can be judged there, a place most of whose view is unknown ground explains much with little.
    const bool explains_more = !mine || static_cast<double>(rival->explained) > config_.global_search.unseat_alone_explains * static_cast<double>(mine->explained);
    const bool alone = as_good <= 1 && rival->support >= config_.global_search.unseat_alone_support && explains_more;
    if (!unseats_tracked(rival->T_map_base * T_start_now_ * T_filter_now.inverse(), T_filter_now, alone)) return false;
  }
  defeats_ = clearly ? defeats_ + 1 : 0;
  const double fraction = !clearly ? 0.3 : defeats_ >= 2 ? 0.95 : 0.5;
  belief->inject(now_, fraction, temperature);
  if (clearly && prior_ == Prior::kGiven) prior_ = Prior::kLocal;
  if (clearly && defeats_ >= 2) prior_ = Prior::kNone;
  why_ = clearly ? "another place of the map fits the scan better"
                 : fmt::format("{} other place(s) of the map fit the scan as well", as_good);
  (void)fields;
  return true;
}

}  // namespace knav
