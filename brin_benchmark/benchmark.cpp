#include "brin_benchmark/benchmark.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "brin_benchmark/ticker.h"
#include "core/error.h"

namespace knav {
namespace {

constexpr double kOdometryPeriod_s = 0.02;

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

/// @param poll  called every simulated second; may throw to stop
Leg drive_leg(BenchmarkRobot& robot, const Waypoint& waypoint, const std::function<void()>& poll,
              const std::function<void()>& collided) {
  Leg leg;
  leg.waypoint = waypoint.name;
  const double start_s = robot.now_s(), start_m = robot.simulator().distance_driven_m();
  const double limit_s = time_limit_s(distance_m(robot.simulator().T_world_base(), waypoint.T_world_robot));
  if (!robot.set_goal(waypoint.T_map_robot)) {
    leg.reason = robot.failure();
  } else {
    Ticker polling(1.0);
    while (true) {
      if (polling.due(robot.now_s())) poll();
      const std::uint32_t collisions = robot.simulator().contacts().collisions;
      const GoalState state = robot.step();
      if (robot.simulator().contacts().collisions > collisions) collided();
      if (state != GoalState::kDriving) {
        leg.reached = state == GoalState::kReached;
        if (!leg.reached) leg.reason = robot.failure();
        break;
      }
      if (robot.now_s() - start_s > limit_s) {
        leg.reason = fmt::format("not reached within {:.0f} s.", limit_s);
        robot.cancel();
        break;
      }
    }
  }
  leg.time_s = robot.now_s() - start_s;
  leg.distance_m = robot.simulator().distance_driven_m() - start_m;
  if (leg.reached)
    leg.positioning_error_m = distance_m(robot.simulator().T_world_base(), waypoint.T_world_robot);
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
      if (command.stuck) {
        const Pose2& at = simulator.T_world_base();
        throw UserError(fmt::format("{}: the robot makes no headway at [{:.2f}, {:.2f}]; change the script there.", setup.tour.file,
                                    at.x_m, at.y_m));
      }
      if (command.mark) builder.mark(now_s);
      simulator.set_command(command.v_mps, command.w_radps);
      builder.add_odometry(now_s, simulator.T_odom_base());
      odometry_buffer.add(now_s, simulator.T_odom_base());
      truth.push_back({now_s, simulator.T_world_base()});
      progress("mapping drive", std::min(0.99, driver.progress()));  // the end comes with the command
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

RunRecord run_sequence(BenchmarkRobot& robot, const Pose2& T_map_start, const std::vector<Waypoint>& waypoints,
                       const BenchmarkProgress& progress, FlightRecorder* recorder) {
  RunRecord record;
  const auto wall_start = Clock::now();
  robot.record(&record.truth, &record.estimate);
  robot.start(T_map_start);
  RunResult& result = record.result;
  const double start_s = robot.now_s();
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const double fraction = static_cast<double>(i) / static_cast<double>(waypoints.size());
    const auto collided = [&] {
      const Pose2& T_world_base = robot.simulator().T_world_base();
      result.collisions_at.push_back({robot.now_s() - start_s, T_world_base.x_m, T_world_base.y_m});
      if (recorder == nullptr) return;
      recorder->failure(fmt::format("{}_{}_collision_{}", i + 1, waypoints[i].name, result.collisions_at.size()),
                        fmt::format("The robot ran into {} at ({:.2f}, {:.2f}) m of the world.", robot.simulator().nearest_thing(), T_world_base.x_m,
                                    T_world_base.y_m));
    };
    result.legs.push_back(drive_leg(robot, waypoints[i], [&] { progress("run", fraction); }, collided));
    const Leg& leg = result.legs.back();
    if (leg.reached) continue;
    const Pose2& T_world_base = robot.simulator().T_world_base();
    record.failed_at.push_back({T_world_base.x_m, T_world_base.y_m});
    if (recorder != nullptr) recorder->failure(fmt::format("{}_{}", i + 1, leg.waypoint), leg.reason);
    if (!robot.place_near(waypoints[i].T_world_robot, waypoints[i].T_map_robot)) {
      throw UserError(fmt::format("no room for the robot within 2 m of waypoint '{}'.", waypoints[i].name));
    }
  }
  progress("run", 1.0);
  result.time_s = robot.now_s() - start_s;
  result.distance_m = robot.simulator().distance_driven_m();
  result.collisions = robot.simulator().contacts().collisions;
  result.walker_contacts = robot.simulator().contacts().walker_contacts;
  result.wall_s = seconds_since(wall_start);
  result.frame_cost_ms = robot.frame_cost_ms();
  result.stage_cost_ms = robot.stage_cost_ms();
  result.frames_dropped = robot.frames_dropped();
  return record;
}

}  // namespace knav
