#pragma once

#include <cmath>
#include <ctime>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "core/distance_transform.h"
#include "core/random.h"
#include "planner_tracker/planner_tracker.h"
#include "planner_tracker/scan_view.h"

namespace knav {

/// A grid drawn with characters, top row first: '#' occupied, '?' unknown, everything else free.
inline OccupancyGrid grid_from_text(const std::vector<std::string>& rows, double resolution_m) {
  OccupancyGrid grid;
  grid.geometry = {static_cast<int>(rows[0].size()), static_cast<int>(rows.size()), resolution_m, 0.0, 0.0};
  grid.value.resize(grid.geometry.cell_count());
  for (int y = 0; y < grid.geometry.height_cells; ++y) {
    const std::string& row = rows[rows.size() - 1 - static_cast<std::size_t>(y)];
    for (int x = 0; x < grid.geometry.width_cells; ++x) {
      const char c = row[static_cast<std::size_t>(x)];
      grid.value[grid.geometry.index(x, y)] = static_cast<std::int8_t>(c == '#' ? 100 : c == '?' ? -1 : 0);
    }
  }
  return grid;
}

/// A free room with walls one cell thick round it.
inline OccupancyGrid room(double width_m, double height_m, double resolution_m = 0.05) {
  OccupancyGrid grid;
  grid.geometry = {static_cast<int>(std::lround(width_m / resolution_m)),
                   static_cast<int>(std::lround(height_m / resolution_m)), resolution_m, 0.0, 0.0};
  grid.value.assign(grid.geometry.cell_count(), 0);
  for (int y = 0; y < grid.geometry.height_cells; ++y) {
    for (int x = 0; x < grid.geometry.width_cells; ++x) {
      if (x == 0 || y == 0 || x + 1 == grid.geometry.width_cells || y + 1 == grid.geometry.height_cells) {
        grid.value[grid.geometry.index(x, y)] = 100;
      }
    }
  }
  return grid;
}

inline void fill(OccupancyGrid* grid, double x0, double y0, double x1, double y1, int value) {
  const GridGeometry& g = grid->geometry;
  for (int y = g.cell_y(y0 + 1e-9); y < g.cell_y(y1 + 1e-9); ++y) {
    for (int x = g.cell_x(x0 + 1e-9); x < g.cell_x(x1 + 1e-9); ++x) {
      if (g.contains(x, y)) grid->value[g.index(x, y)] = static_cast<std::int8_t>(value);
    }
  }
}

/// A scan all round that meets nothing nearer than 10 m.
inline ScanView open_view() {
  RangeScan scan;
  scan.angle_min_rad = -static_cast<float>(kPi);
  scan.angle_increment_rad = static_cast<float>(2.0 * kPi / 360);
  scan.range_max_m = 20.0f;
  scan.range_m.assign(360, 10.0f);
  scan.evidence.assign(360, 1.0f);
  ScanView view(3.0, 1.0);
  view.set(scan, Pose2{});
  view.place(Pose2{}, Pose2{});
  return view;
}

struct Disc {
  std::function<Point2(double t_s)> where;
  double radius_m = 0.25;
};

/// A robot with a camera of 57 deg and a memory of what it saw, in a flat world of cells and discs. What the
/// mapper does is done exactly: cells on rays of the view become free or occupied, all others keep what they
/// were, and scan_360 is cast through that memory.
class ToyWorld {
 public:
  ToyWorld(const OccupancyGrid& truth, const OccupancyGrid& map, const Pose2& start,
           const PlannerTrackerConfig& config = {})
      : truth_(truth), T_map_base(start), planner(config), config_(config) {
    memory_ = truth;
    memory_.value.assign(truth.value.size(), -1);
    update_truth();
    planner.set_map({}, map, {});
  }

  OccupancyGrid& truth() { return truth_; }
  void update_truth() {
    std::vector<std::uint8_t> occupied(truth_.value.size());
    for (std::size_t i = 0; i < occupied.size(); ++i) occupied[i] = truth_.value[i] > 50;
    clearance_m_ = euclidean_distance_m(truth_.geometry, occupied);
  }

  /// One control period. Returns the command.
  Command step() {
    const double dt = 1.0 / config_.controller_frequency;
    now_s += dt;
    move(dt);
    const Pose2 T_odom_base = T_map_odom.inverse() * T_map_base;
    RobotState robot;
    robot.has_pose = true;
    robot.odom_stamp_s = now_s;
    robot.T_odom_base = T_odom_base;
    robot.v_mps = v_mps;
    robot.w_radps = w_radps;
    robot.localization = localization;
    robot.localization_stamp_s = now_s;
    robot.pose_stamp_s = now_s;
    RandomStream noise(7, random_stream::kTest, static_cast<std::uint64_t>(frame_), 0);
    const Pose2 error{noise.normal(0.0, pose_noise_m), noise.normal(0.0, pose_noise_m),
                      noise.normal(0.0, 0.3 * pose_noise_m)};
    robot.T_map_base = T_map_base * error;
    if (sensor_alive) {
      if (frame_ % 2 == 0) look();
      if (frame_ % 4 == 0) planner.set_local_map(memory_, robot.T_map_base * T_map_base.inverse());
      planner.set_scan(cast_scan(), Pose2{});
    }
    ++frame_;
    const double began_ms = cpu_ms();
    const Command command = planner.step(now_s, robot);
    planner_ms += cpu_ms() - began_ms;
    ++steps;
    command_v_ = command.v_mps;
    command_w_ = command.w_radps;
    track(command);
    return command;
  }

  /// Until the goal ends or this time passed.
  Command run(double longest_s) {
    Command command;
    const double until = now_s + longest_s;
    while (now_s < until) {
      command = step();
      if (command.finished) break;
    }
    return command;
  }

  double distance_to(const Pose2& pose) const { return distance_m(T_map_base, pose); }

  static double cpu_ms() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
  }

 private:
  void move(double dt) {
    // The base's own limits, a little above the planner's.
    const auto limit = [](double from, double to, double step) {
      return std::max(from - step, std::min(from + step, to));
    };
    v_mps = limit(v_mps, command_v_, 1.0 * dt);
    w_radps = limit(w_radps, command_w_, 4.0 * dt);
    const double middle = T_map_base.yaw_rad + 0.5 * w_radps * dt;
    T_map_base.x_m += v_mps * dt * std::cos(middle);
    T_map_base.y_m += v_mps * dt * std::sin(middle);
    T_map_base.yaw_rad = normalize_angle_rad(T_map_base.yaw_rad + w_radps * dt);
    driven_m += std::abs(v_mps) * dt;
    bool touching = false;
    const GridGeometry& g = truth_.geometry;
    const int ix = g.cell_x(T_map_base.x_m), iy = g.cell_y(T_map_base.y_m);
    // Cell centre to cell centre, less half a cell at each end.
    const double wall =
        g.contains(ix, iy) ? static_cast<double>(clearance_m_[g.index(ix, iy)]) - 0.5 * g.resolution_m : 0.0;
    least_clearance_m = std::min(least_clearance_m, wall);
    if (wall + 0.5 * g.resolution_m < config_.robot_radius) touching = true;
    for (const Disc& disc : discs) {
      const Point2 p = disc.where(now_s);
      const double gap = std::hypot(p.x_m - T_map_base.x_m, p.y_m - T_map_base.y_m) - disc.radius_m;
      if (gap < config_.robot_radius) touching = true;
    }
    if (touching && !touching_) ++collisions;
    touching_ = touching;
  }

  bool solid(double x, double y) const {
    const GridGeometry& g = truth_.geometry;
    const int ix = g.cell_x(x), iy = g.cell_y(y);
    if (!g.contains(ix, iy) || truth_.value[g.index(ix, iy)] > 50) return true;
    for (const Point2& p : disc_now_) {
      const double dx = x - p.x_m, dy = y - p.y_m;
      if (dx * dx + dy * dy < 0.0625) return true;
    }
    return false;
  }

  void look() {
    disc_now_.clear();
    for (const Disc& disc : discs) disc_now_.push_back(disc.where(now_s));
    const GridGeometry& g = memory_.geometry;
    const double half = 0.5 * 57.0 * kPi / 180.0;
    std::vector<std::size_t> hits;
    for (int i = 0; i <= 200; ++i) {
      const double angle = T_map_base.yaw_rad - half + 2.0 * half * i / 200.0;
      for (double r = 0.02; r < memory_range_m; r += 0.6 * g.resolution_m) {
        const double x = T_map_base.x_m + r * std::cos(angle), y = T_map_base.y_m + r * std::sin(angle);
        const int ix = g.cell_x(x), iy = g.cell_y(y);
        if (!g.contains(ix, iy)) break;
        if (solid(x, y)) {
          hits.push_back(g.index(ix, iy));
          break;
        }
        if (r >= sees_free_from_m) memory_.value[g.index(ix, iy)] = 0;
      }
    }
    for (const std::size_t i : hits) memory_.value[i] = 100;
  }

  RangeScan cast_scan() const {
    RangeScan scan;
    scan.stamp_s = now_s;
    constexpr int kRays = 360;
    scan.angle_min_rad = -kPi;
    scan.angle_increment_rad = 2.0 * kPi / kRays;
    scan.range_max_m = 6.0;
    scan.range_m.resize(kRays);
    const GridGeometry& g = memory_.geometry;
    for (int i = 0; i < kRays; ++i) {
      const double angle = T_map_base.yaw_rad + scan.angle_min_rad + i * scan.angle_increment_rad;
      float& range = scan.range_m[static_cast<std::size_t>(i)];
      range = std::numeric_limits<float>::infinity();
      for (double r = 0.05; r < scan.range_max_m; r += 0.6 * g.resolution_m) {
        const int ix = g.cell_x(T_map_base.x_m + r * std::cos(angle)),
                  iy = g.cell_y(T_map_base.y_m + r * std::sin(angle));
        const int value = g.contains(ix, iy) ? memory_.value[g.index(ix, iy)] : -1;
        if (value > 50) range = static_cast<float>(r);
        if (value < 0 && r > 1.0) range = std::numeric_limits<float>::quiet_NaN();
        if (value > 50 || (value < 0 && r > 1.0)) break;
      }
    }
    return scan;
  }

  void track(const Command& command) {
    const int sign = command.v_mps > 0.01 ? 1 : command.v_mps < -0.01 ? -1 : 0;
    if (sign != 0 && last_sign_ != 0 && sign != last_sign_) ++reversals;
    if (sign != 0) last_sign_ = sign;
    if (command.activity == Activity::kAvoiding && last_activity_ != Activity::kAvoiding) ++avoidances;
    last_activity_ = command.activity;
    max_v_mps = std::max(max_v_mps, std::abs(command.v_mps));
    max_w_radps = std::max(max_w_radps, std::abs(command.w_radps));
    trail.push_back({T_map_base.x_m, T_map_base.y_m});
  }

  OccupancyGrid truth_, memory_;
  std::vector<float> clearance_m_;
  std::vector<Point2> disc_now_;
  double command_v_ = 0.0, command_w_ = 0.0;
  bool touching_ = false;
  long frame_ = 0;
  int last_sign_ = 0;
  Activity last_activity_ = Activity::kIdle;

 public:
  Pose2 T_map_base;
  Pose2 T_map_odom{1.0, -0.5, 0.3};
  PlannerTracker planner;
  LocalizationState localization = LocalizationState::kOk;
  std::vector<Disc> discs;
  bool sensor_alive = true;
  double memory_range_m = 8.0;
  double sees_free_from_m = 0.0;  ///< nearer than this, what was seen occupied stays so
  double pose_noise_m = 0.005;
  double now_s = 100.0, v_mps = 0.0, w_radps = 0.0;

  int collisions = 0, reversals = 0, avoidances = 0;
  double planner_ms = 0.0;  ///< CPU time in PlannerTracker::step()
  int steps = 0;
  double driven_m = 0.0, least_clearance_m = 1e9, max_v_mps = 0.0, max_w_radps = 0.0;
  std::vector<Point2> trail;

 private:
  PlannerTrackerConfig config_;
};

}  // namespace knav
