#include "planner_tracker/walkers.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr double kTogether_m = 0.3;   ///< cells nearer to each other than this are one person's
constexpr double kWidest_m = 1.0;     ///< what is wider is no person
constexpr double kSame_m = 0.6;       ///< so far from where he was expected it is still the same
constexpr double kAlpha = 0.4, kBeta = 0.1;  ///< gains of the filter, all but critically damped (beta = alpha^2 / (2 - alpha))
constexpr double kWalked_m = 0.4;     ///< from where he began
constexpr double kSlowest_mps = 0.25, kFastest_mps = 2.0;
constexpr double kForgotten_s = 3.0;
constexpr double kMissed_s = 0.5;     ///< in view and not seen for so long: he is not there
constexpr double kWentOn_s = 0.5, kWentOnStep_s = 0.25;
constexpr double kHalfView_rad = 0.45;  ///< less than 57 degrees, by what the edges may miss
constexpr double kViewFrom_m = 0.7, kViewTo_m = 4.0;

double away_m(const Point2& a, const Point2& b) { return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m); }

}  // namespace

bool in_view(const Point2& in_robot, double from_m, double to_m) {
  const double distance = std::hypot(in_robot.x_m, in_robot.y_m);
  return distance > from_m && distance < to_m && std::abs(std::atan2(in_robot.y_m, in_robot.x_m)) < kHalfView_rad;
}

bool in_view(const Pose2& T_map_robot, const Point2& at) { return in_view(T_map_robot.inverse() * at, kViewFrom_m, kViewTo_m); }

Point2 Walkers::at(const Track& track, double now_s) {
  const double dt = now_s - track.seen_s;
  return {track.at.x_m + track.v_mps.x_m * dt, track.at.y_m + track.v_mps.y_m * dt};
}

void Walkers::cluster(const std::vector<Point2>& moving) {
  clusters_.clear();
  left_.resize(moving.size());
  for (std::size_t i = 0; i < moving.size(); ++i) left_[i] = i;
  while (!left_.empty()) {
    open_.assign(1, left_.back());
    left_.pop_back();
    double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9;
    for (std::size_t k = 0; k < open_.size(); ++k) {
      const Point2 p = moving[open_[k]];
      x0 = std::min(x0, p.x_m), x1 = std::max(x1, p.x_m);
      y0 = std::min(y0, p.y_m), y1 = std::max(y1, p.y_m);
      const auto beside = [&](std::size_t i) { return away_m(moving[i], p) < kTogether_m; };
      const auto middle = std::partition(left_.begin(), left_.end(), [&](std::size_t i) { return !beside(i); });
      open_.insert(open_.end(), middle, left_.end());
      left_.erase(middle, left_.end());
    }
    if (std::max(x1 - x0, y1 - y0) <= kWidest_m) clusters_.push_back({0.5 * (x0 + x1), 0.5 * (y0 + y1)});
  }
}

void Walkers::update(const std::vector<Point2>& moving, const MapLayer& layer, const Pose2& T_map_robot, double now_s) {
  cluster(moving);
  // Out of view the local map keeps him where he was: nothing was seen of him there.
  clusters_.erase(std::remove_if(clusters_.begin(), clusters_.end(), [&](const Point2& c) { return !in_view(T_map_robot, c); }), clusters_.end());
  lose(T_map_robot, now_s);
  for (Track& track : tracks_) {
    const Point2 expected = at(track, now_s);
    auto nearest = clusters_.end();
    for (auto c = clusters_.begin(); c != clusters_.end(); ++c) {
      if (away_m(*c, expected) < (nearest == clusters_.end() ? kSame_m : away_m(*nearest, expected))) nearest = c;
    }
    if (nearest == clusters_.end()) continue;
    const double per_s = kBeta / std::max(0.05, now_s - track.seen_s);
    const Point2 off{nearest->x_m - expected.x_m, nearest->y_m - expected.y_m};
    track.at = {expected.x_m + kAlpha * off.x_m, expected.y_m + kAlpha * off.y_m};
    track.v_mps = {track.v_mps.x_m + per_s * off.x_m, track.v_mps.y_m + per_s * off.y_m};
    track.seen_s = now_s;
    clusters_.erase(nearest);
    const int ix = layer.geometry.cell_x(track.began_at.x_m), iy = layer.geometry.cell_y(track.began_at.y_m);
    track.walks = track.walks || (away_m(track.at, track.began_at) > kWalked_m && layer.at(ix, iy) != CellState::kOccupied);
  }
  const auto gone = [&](const Track& track) {
    const double unseen_s = now_s - track.seen_s;
    return unseen_s < 0.0 || unseen_s > kForgotten_s || (!track.walks && unseen_s > kMissed_s) ||
           (unseen_s > kMissed_s && in_view(T_map_robot, at(track, now_s)));
  };
  tracks_.erase(std::remove_if(tracks_.begin(), tracks_.end(), gone), tracks_.end());
  for (const Point2& c : clusters_) tracks_.push_back({c, {0.0, 0.0}, c, now_s, false});
}

/// Whom no cluster shows any more, and who is out of view, may stand anywhere on the next bit of his way.
void Walkers::lose(const Pose2& T_map_robot, double now_s) {
  if (may_stand_s_ <= 0.0) return;
  const auto shown = [&](const Point2& p) {
    return std::any_of(clusters_.begin(), clusters_.end(), [&](const Point2& c) { return away_m(c, p) < kSame_m; });
  };
  for (const Track& track : tracks_) {
    const bool known = std::any_of(lost_.begin(), lost_.end(), [&](const Track& l) { return l.seen_s == track.seen_s && away_m(l.at, track.at) < 1e-6; });
    if (track.walks && !known && track.seen_s < now_s && !in_view(T_map_robot, track.at) && !shown(track.at)) lost_.push_back(track);
  }
  const auto found = [&](const Track& l) {
    const double age_s = now_s - l.seen_s;
    return age_s < 0.0 || age_s > may_stand_s_ || in_view(T_map_robot, l.at) || shown(l.at);
  };
  lost_.erase(std::remove_if(lost_.begin(), lost_.end(), found), lost_.end());
  may_stand_at_.clear();
  for (const Track& l : lost_) {
    for (double t = 0.0; t <= kWentOn_s; t += kWentOnStep_s) {
      const Point2 p{l.at.x_m + t * l.v_mps.x_m, l.at.y_m + t * l.v_mps.y_m};
      if (!in_view(T_map_robot, p)) may_stand_at_.push_back(p);
    }
  }
}

void Walkers::expected(double now_s, double memory_s, std::vector<Walker>* walkers) const {
  walkers->clear();
  for (const Track& track : tracks_) {
    const double speed = std::hypot(track.v_mps.x_m, track.v_mps.y_m);
    if (!track.walks || now_s - track.seen_s > memory_s || speed < kSlowest_mps || speed > kFastest_mps) continue;
    walkers->push_back({at(track, now_s), track.v_mps});
  }
}

}  // namespace knav
