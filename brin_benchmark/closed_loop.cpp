#include "brin_benchmark/closed_loop.h"

#include <algorithm>
#include <chrono>

#include "brin_benchmark/set_down.h"
#include "core/error.h"

namespace knav {
namespace {

constexpr double kOdometryPeriod_s = 0.02;
constexpr double kControlPeriod_s = 0.05;
constexpr double kTrackPeriod_s = 0.1;

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace

ClosedLoop::ClosedLoop(const SimulatorConfig& simulator, const NavigationStackConfig& stack, const WorldConfig& world,
                       const MapDirectory& map, FlightRecorder* recorder)
    : simulator_(world, simulator),
      stack_(stack),
      recorder_(recorder),
      odometry_(kOdometryPeriod_s),
      control_(kControlPeriod_s),
      track_(kTrackPeriod_s) {
  stack_.set_map(map);
}

void ClosedLoop::record(Trajectory* truth, Trajectory* estimate) {
  truth_ = truth;
  estimate_ = estimate;
}

const Command& ClosedLoop::step() {
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
    const double took_s = seconds_since(start);
    stack_s_ += took_s;
    control_max_s_ = std::max(control_max_s_, took_s);
  }
  if (truth_ != nullptr && track_.due(now_s())) {
    truth_->push_back({now_s(), simulator_.T_world_base()});
    Pose2 T_map_robot;
    if (stack_.estimate(&T_map_robot)) estimate_->push_back({now_s(), T_map_robot});
  }
  return command_;
}

void ClosedLoop::start(const Pose2& T_map_robot) {
  stack_.place(T_map_robot);
  settle();
}

bool ClosedLoop::place_near(const Pose2& T_world_robot, const Pose2& T_map_robot) {
  return set_down_near([&](const Pose2& aside) {
    if (!kidnap(T_world_robot * aside)) return false;
    start(T_map_robot * aside);
    return true;
  });
}

bool ClosedLoop::kidnap(const Pose2& T_world_robot, double room_m) {
  try {
    simulator_.set_pose(T_world_robot, room_m);
  } catch (const UserError&) {
    return false;  // something stands there
  }
  return true;
}

void ClosedLoop::settle() {
  command_ = {};
  for (const double until_s = now_s() + 1.0; now_s() < until_s;) step();
}

void ClosedLoop::add_odometry() {
  const Pose2 T = simulator_.T_odom_base();
  const Pose2 moved = last_T_odom_.inverse() * T;
  const double dt_s = std::max(1e-6, now_s() - last_odometry_s_);
  stack_.add_odometry(now_s(), T, moved.x_m / dt_s, moved.yaw_rad / dt_s);
  last_T_odom_ = T;
  last_odometry_s_ = now_s();
}

}  // namespace knav
