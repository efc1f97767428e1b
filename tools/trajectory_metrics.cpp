#include "tools/trajectory_metrics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "core/error.h"
#include "core/file_io.h"

namespace knav {
namespace {

/// Mean and standard deviation of absolute errors, gathered one by one.
class Gatherer {
 public:
  void add(const Pose2& T_true, const Pose2& T_estimated) {
    const Pose2 error = T_true.inverse() * T_estimated;
    translation_.push_back(std::hypot(error.x_m, error.y_m));
    rotation_.push_back(std::fabs(error.yaw_rad) * 180.0 / kPi);
  }
  ErrorStatistics statistics() const {
    ErrorStatistics result;
    result.count = static_cast<int>(translation_.size());
    moments(translation_, &result.translation_mean_m, &result.translation_sd_m);
    moments(rotation_, &result.rotation_mean_deg, &result.rotation_sd_deg);
    for (const double v : translation_) result.translation_max_m = std::max(result.translation_max_m, v);
    return result;
  }

 private:
  static void moments(const std::vector<double>& values, double* mean, double* sd) {
    if (values.empty()) return;
    const double n = static_cast<double>(values.size());
    double sum = 0.0, squares = 0.0;
    for (const double v : values) sum += v;
    *mean = sum / n;
    for (const double v : values) squares += (v - *mean) * (v - *mean);
    *sd = std::sqrt(squares / n);
  }
  std::vector<double> translation_, rotation_;
};

}  // namespace

std::vector<Relation> read_relations(const std::string& path) {
  std::vector<Relation> relations;
  std::istringstream lines(read_text_file(path));
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const auto start = line.find_first_not_of(" \t\r");
    if (start == std::string::npos || line[start] == '#') continue;
    std::istringstream fields(line);
    double v[8];
    for (double& value : v) {
      if (!(fields >> value)) {
        throw UserError(fmt::format("{}: line {}: expected 't1 t2 x y z roll pitch yaw'.", path, number));
      }
    }
    relations.push_back({v[0], v[1], {v[2], v[3], normalize_angle_rad(v[7])}});
  }
  if (relations.empty()) throw UserError(path + ": holds no relations.");
  return relations;
}

ErrorStatistics relation_error(const Trajectory& estimate, const std::vector<Relation>& relations, double max_span_s,
                               double max_gap_s) {
  Gatherer errors;
  for (const Relation& relation : relations) {
    if (max_span_s > 0.0 && std::fabs(relation.to_s - relation.from_s) >= max_span_s) continue;
    Pose2 T_from, T_to;
    if (!interpolate_at(estimate, relation.from_s, max_gap_s, &T_from) ||
        !interpolate_at(estimate, relation.to_s, max_gap_s, &T_to)) {
      continue;
    }
    errors.add(relation.T_from_to, T_from.inverse() * T_to);
  }
  return errors.statistics();
}

ErrorStatistics segment_error(const Trajectory& estimate, const Trajectory& reference, double length_m,
                              double max_gap_s) {
  std::vector<double> path_m(reference.size(), 0.0);
  for (std::size_t i = 1; i < reference.size(); ++i) {
    path_m[i] = path_m[i - 1] + distance_m(reference[i - 1].T_map_robot, reference[i].T_map_robot);
  }
  Gatherer errors;
  std::size_t end = 0;
  for (std::size_t start = 0; start < reference.size(); ++start) {
    while (end < reference.size() && path_m[end] - path_m[start] < length_m) ++end;
    if (end == reference.size()) break;
    Pose2 T_start, T_end;
    if (!interpolate_at(estimate, reference[start].stamp_s, max_gap_s, &T_start) ||
        !interpolate_at(estimate, reference[end].stamp_s, max_gap_s, &T_end)) {
      continue;
    }
    errors.add(reference[start].T_map_robot.inverse() * reference[end].T_map_robot, T_start.inverse() * T_end);
  }
  return errors.statistics();
}

double absolute_trajectory_error_m(const Trajectory& estimate, const Trajectory& reference, int* matched,
                                   double max_gap_s) {
  std::vector<Point2> from, to;
  for (const auto& [stamp_s, T_true] : reference) {
    Pose2 T;
    if (!interpolate_at(estimate, stamp_s, max_gap_s, &T)) continue;
    from.push_back({T.x_m, T.y_m});
    to.push_back({T_true.x_m, T_true.y_m});
  }
  *matched = static_cast<int>(from.size());
  if (from.empty()) return 0.0;
  const Pose2 T_true_estimate = best_rigid_transform(from, to);
  double squares = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Point2 p = T_true_estimate * from[i];
    squares += (p.x_m - to[i].x_m) * (p.x_m - to[i].x_m) + (p.y_m - to[i].y_m) * (p.y_m - to[i].y_m);
  }
  return std::sqrt(squares / static_cast<double>(from.size()));
}

Pose2 best_rigid_transform(const std::vector<Point2>& from, const std::vector<Point2>& to) {
  const double n = static_cast<double>(from.size());
  if (from.empty()) return {};
  double fx = 0, fy = 0, tx = 0, ty = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    fx += from[i].x_m / n;
    fy += from[i].y_m / n;
    tx += to[i].x_m / n;
    ty += to[i].y_m / n;
  }
  double dot = 0, cross = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const double ax = from[i].x_m - fx, ay = from[i].y_m - fy, bx = to[i].x_m - tx, by = to[i].y_m - ty;
    dot += ax * bx + ay * by;
    cross += ax * by - ay * bx;
  }
  Pose2 T{0.0, 0.0, std::atan2(cross, dot)};
  const Point2 moved = T * Point2{fx, fy};
  T.x_m = tx - moved.x_m;
  T.y_m = ty - moved.y_m;
  return T;
}

}  // namespace knav
