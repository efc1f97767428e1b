#include "planner_tracker/path.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr double kLookBack_m = 0.3, kLookOn_m = 2.5;

}  // namespace

void Path::set(const std::vector<Point2>& points) {
  points_.assign(points.begin(), points.end());
  along_m_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    along_m_[i] = i == 0 ? 0.0
                         : along_m_[i - 1] + std::hypot(points_[i].x_m - points_[i - 1].x_m,
                                                        points_[i].y_m - points_[i - 1].y_m);
  }
  at_m_ = offset_m_ = 0.0;
}

void Path::advance(const Point2& robot) {
  if (empty()) return;
  const double low = at_m_ - kLookBack_m, high = at_m_ + kLookOn_m;
  double best = std::numeric_limits<double>::infinity(), best_at = at_m_;
  if (points_.size() == 1) best = std::hypot(robot.x_m - points_[0].x_m, robot.y_m - points_[0].y_m);
  for (std::size_t i = 1; i < points_.size(); ++i) {
    if (along_m_[i] < low) continue;
    if (along_m_[i - 1] > high) break;
    const Point2 &a = points_[i - 1], &b = points_[i];
    const double dx = b.x_m - a.x_m, dy = b.y_m - a.y_m, squared = dx * dx + dy * dy;
    double t = squared > 0.0 ? ((robot.x_m - a.x_m) * dx + (robot.y_m - a.y_m) * dy) / squared : 0.0;
    t = std::clamp(t, 0.0, 1.0);
    const double d = std::hypot(a.x_m + t * dx - robot.x_m, a.y_m + t * dy - robot.y_m);
    if (d < best) {
      best = d;
      best_at = along_m_[i - 1] + t * (along_m_[i] - along_m_[i - 1]);
    }
  }
  at_m_ = best_at;
  offset_m_ = best;
}

Point2 Path::point_at(double along_m) const {
  if (along_m <= 0.0) return points_.front();
  if (along_m >= length_m()) return points_.back();
  const auto after = static_cast<std::size_t>(std::upper_bound(along_m_.begin(), along_m_.end(), along_m) -
                                              along_m_.begin());
  const Point2 &a = points_[after - 1], &b = points_[after];
  const double t = (along_m - along_m_[after - 1]) / (along_m_[after] - along_m_[after - 1]);
  return {a.x_m + t * (b.x_m - a.x_m), a.y_m + t * (b.y_m - a.y_m)};
}

void Path::rest(std::vector<Point2>* points) const {
  points->clear();
  if (empty()) return;
  points->push_back(point_at(at_m_));
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (along_m_[i] > at_m_ + 1e-6) points->push_back(points_[i]);
  }
}

}  // namespace knav
