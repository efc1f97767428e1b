#include "brin_benchmark/benchmark.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "core/error.h"

namespace knav {
namespace {

constexpr double kOdometryPeriod_s = 0.02;
constexpr double kControlPeriod_s = 0.05;
constexpr double kTrackPeriod_s = 0.1;

/// What the benchmark allows for a leg: an honest pace of 0.2 m/s along a way twice the straight one, and a
/// minute.
double time_limit_s(double straight_m) { return 60.0 + 2.0 * straight_m / 0.2; }

Pose2 planar_camera(const Eigen::Isometry3d& T_base_optical) {
  const Eigen::Vector3d forward = T_base_optical.rotation().col(2);
  return {T_base_optical.translation().x(), T_base_optical.translation().y(),
          std::atan2(forward.y(), forward.x())};
}

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// True once per period of simulated time.
class Ticker {
 public:
  explicit Ticker(double period_s) : period_s_(period_s) {}
  bool due(double now_s) {
    if (now_s < next_s_ - 1e-9) return false;
    next_s_ = std::max(next_s_ + period_s_, now_s);
    return true;
  }

 private:
  double period_s_;
  double next_s_ = 0.0;
};

/// The robot, its stack and the building, advanced together.
class ClosedLoop {
 public:
  ClosedLoop(const BenchmarkSetup& setup, const WorldConfig& world, const MapDirectory& map,
             RunRecord* record, FlightRecorder* recorder)
      : simulator_(world, setup.simulator), stack_(setup.stack), record_(record), recorder_(recorder) {
    stack_.set_map(map);
  }

  Simulator& simulator() { return simulator_; }
  NavigationStack& stack() { return stack_; }
  double now_s() const { return simulator_.stamp_s(); }

  /// One physics step, with all that falls due. Returns the newest command.
  const Command& step() {
    simulator_.set_command(command_.v_mps, command_.w_radps);
    simulator_.step();
    if (odometry_.due(now_s())) add_odometry();
    if (simulator_.next_frame(&request_)) {
      simulator_.render(request_, &depth_);
      const auto start = Clock::now();
      stack_.add_depth(depth_, simulator_.camera(), request_.stamp_s, simulator_.T_base_optical());
      stack_s_ += seconds_since(start);
      ++frames_;
      if (recorder_ != nullptr) {
        recorder_->frame(request_.stamp_s, simulator_.T_world_base(), simulator_.T_odom_base(), stack_);
      }
    }
    command_.finished = false;
    if (control_.due(now_s())) {
      const auto start = Clock::now();
      command_ = stack_.control(now_s());
      stack_s_ += seconds_since(start);
    }
    if (track_.due(now_s())) {
      record_->truth.push_back({now_s(), simulator_.T_world_base()});
      Pose2 T_map_robot;
      if (stack_.estimate(&T_map_robot)) record_->estimate.push_back({now_s(), T_map_robot});
    }
    return command_;
  }

  /// Sets the robot down and lets it look for a second; beside the waypoint if something stands on it.
  void place(const Waypoint& waypoint) {
    Pose2 aside;
    for (int ring = 0; ring <= 8; ++ring) {
      for (int k = 0; k < (ring == 0 ? 1 : 12); ++k) {
        const double angle = k * kPi / 6.0;
        aside = {0.25 * ring * std::cos(angle), 0.25 * ring * std::sin(angle), 0.0};
        if (!put(waypoint.T_world_robot * aside)) continue;
        stack_.place(waypoint.T_map_robot * aside);
        settle();
        return;
      }
    }
    throw UserError(fmt::format("no room for the robot within 2 m of waypoint '{}'.", waypoint.name));
  }

  /// Of the robot's own work (all but the simulation), a frame.
  double frame_cost_ms() const { return frames_ > 0 ? 1e3 * stack_s_ / static_cast<double>(frames_) : 0.0; }

  void start(const Pose2& T_map_robot) {
    stack_.place(T_map_robot);
    settle();
  }

 private:
  bool put(const Pose2& T_world_base) {
    try {
      simulator_.set_pose(T_world_base);
    } catch (const UserError&) {
      return false;  // something stands there
    }
    return true;
  }

  void settle() {
    command_ = {};
    for (const double until_s = now_s() + 1.0; now_s() < until_s;) step();
  }

  void add_odometry() {
    const Pose2 T = simulator_.T_odom_base();
    const Pose2 moved = last_T_odom_.inverse() * T;
    const double dt_s = std::max(1e-6, now_s() - last_odometry_s_);
    stack_.add_odometry(now_s(), T, moved.x_m / dt_s, moved.yaw_rad / dt_s);
    last_T_odom_ = T;
    last_odometry_s_ = now_s();
  }

  Simulator simulator_;
  NavigationStack stack_;
  RunRecord* record_;
  FlightRecorder* recorder_;
  double stack_s_ = 0.0;
  std::size_t frames_ = 0;
  FrameRequest request_;
  cv::Mat depth_;
  Command command_;
  Ticker odometry_{kOdometryPeriod_s}, control_{kControlPeriod_s}, track_{kTrackPeriod_s};
  Pose2 last_T_odom_;
  double last_odometry_s_ = 0.0;
};

/// @param poll  called every simulated second; may throw to stop
Leg drive_leg(ClosedLoop& loop, const Waypoint& waypoint, const std::function<void()>& poll,
              const std::function<void()>& collided) {
  Leg leg;
  leg.waypoint = waypoint.name;
  const double start_s = loop.now_s(), start_m = loop.simulator().distance_driven_m();
  const double limit_s = time_limit_s(distance_m(loop.simulator().T_world_base(), waypoint.T_world_robot));
  if (!loop.stack().set_goal(waypoint.T_map_robot)) {
    leg.reason = loop.stack().failure().reason;
  } else {
    Ticker polling(1.0);
    while (true) {
      if (polling.due(loop.now_s())) poll();
      const std::uint32_t collisions = loop.simulator().contacts().collisions;
      const Command& command = loop.step();
      if (loop.simulator().contacts().collisions > collisions) collided();
      if (command.finished) {
        leg.reached = command.activity == Activity::kReached;
        if (!leg.reached) leg.reason = loop.stack().failure().reason;
        break;
      }
      if (loop.now_s() - start_s > limit_s) {
        leg.reason = fmt::format("not reached within {:.0f} s.", limit_s);
        loop.stack().cancel();
        break;
      }
    }
  }
  leg.time_s = loop.now_s() - start_s;
  leg.distance_m = loop.simulator().distance_driven_m() - start_m;
  if (leg.reached)
    leg.positioning_error_m = distance_m(loop.simulator().T_world_base(), waypoint.T_world_robot);
  return leg;
}

}  // namespace

BuiltMap map_world(const BenchmarkSetup& setup, std::vector<Waypoint>* waypoints,
                   const BenchmarkProgress& progress) {
  Simulator simulator(setup.world, setup.simulator);
  FrontEnd front_end(setup.stack.front_end);
  MapBuilder builder(setup.map_builder, setup.stack.local_mapper);
  TourDriver driver(setup.tour);
  PoseBuffer odometry_buffer;
  Trajectory truth;
  FrameRequest request;
  cv::Mat depth;
  DepthProfile profile;
  Ticker control(kOdometryPeriod_s);
  const Eigen::Isometry3d T_base_optical = simulator.T_base_optical();
  while (true) {
    const double now_s = simulator.stamp_s();
    if (control.due(now_s)) {
      const TourDriver::Command command = driver.step(now_s, simulator.T_world_base());
      if (command.done) break;
      if (command.stuck) throw UserError(setup.tour.file + ": the robot makes no headway.");
      if (command.mark) builder.mark(now_s);
      simulator.set_command(command.v_mps, command.w_radps);
      builder.add_odometry(now_s, simulator.T_odom_base());
      odometry_buffer.add(now_s, simulator.T_odom_base());
      truth.push_back({now_s, simulator.T_world_base()});
      progress("mapping drive", driver.progress());
    }
    simulator.step();
    if (!simulator.next_frame(&request)) continue;
    simulator.render(request, &depth);
    if (front_end.process(depth, simulator.camera(), request.stamp_s, T_base_optical, odometry_buffer,
                          &profile)) {
      builder.add(profile, planar_camera(T_base_optical));
    }
  }
  BuiltMap built = builder.build([&](const char* stage, double fraction) { progress(stage, fraction); });

  waypoints->clear();
  for (const std::string& name : setup.sequence) {
    const auto place = setup.world.places.find(name);
    if (place == setup.world.places.end()) {
      throw UserError(fmt::format("{}: no place '{}', which the sequence names.", setup.world.file, name));
    }
    double best_m = std::numeric_limits<double>::infinity();
    Waypoint waypoint;
    waypoint.name = name;
    for (const StampedPose2& pose : truth) {
      const double d = distance_m(pose.T_map_robot, place->second);
      Pose2 T_map_robot;
      if (d < best_m && interpolate_at(built.map.trajectory, pose.stamp_s, 1.0, &T_map_robot)) {
        best_m = d;
        waypoint.T_world_robot = pose.T_map_robot;
        waypoint.T_map_robot = T_map_robot;
      }
    }
    if (best_m > setup.waypoint_within_m) {
      throw UserError(fmt::format("{}: the tour passes place '{}' at {:.1f} m only; lead it there.",
                                  setup.tour.file, name, best_m));
    }
    waypoints->push_back(waypoint);
  }
  return built;
}

RunRecord run_sequence(const BenchmarkSetup& setup, const WorldConfig& changed, const MapDirectory& map,
                       const std::vector<Waypoint>& waypoints, const BenchmarkProgress& progress,
                       FlightRecorder* recorder) {
  RunRecord record;
  const auto wall_start = Clock::now();
  ClosedLoop loop(setup, changed, map, &record, recorder);
  loop.start(Pose2{});
  RunResult& result = record.result;
  const double start_s = loop.now_s();
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const double fraction = static_cast<double>(i) / static_cast<double>(waypoints.size());
    const auto collided = [&] {
      const Pose2& T_world_base = loop.simulator().T_world_base();
      result.collisions_at.push_back({loop.now_s() - start_s, T_world_base.x_m, T_world_base.y_m});
      if (recorder == nullptr) return;
      recorder->failure(fmt::format("{}_{}_collision_{}", i + 1, waypoints[i].name, result.collisions_at.size()),
                        fmt::format("The robot ran into something at ({:.2f}, {:.2f}) m of the world.", T_world_base.x_m,
                                    T_world_base.y_m));
    };
    result.legs.push_back(drive_leg(loop, waypoints[i], [&] { progress("run", fraction); }, collided));
    const Leg& leg = result.legs.back();
    if (leg.reached) continue;
    const Pose2& T_world_base = loop.simulator().T_world_base();
    record.failed_at.push_back({T_world_base.x_m, T_world_base.y_m});
    if (recorder != nullptr) recorder->failure(fmt::format("{}_{}", i + 1, leg.waypoint), leg.reason);
    loop.place(waypoints[i]);
  }
  progress("run", 1.0);
  result.time_s = loop.now_s() - start_s;
  result.distance_m = loop.simulator().distance_driven_m();
  result.collisions = loop.simulator().contacts().collisions;
  result.walker_contacts = loop.simulator().contacts().walker_contacts;
  result.wall_s = seconds_since(wall_start);
  result.frame_cost_ms = loop.frame_cost_ms();
  return record;
}

}  // namespace knav
