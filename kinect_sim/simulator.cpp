#include "kinect_sim/simulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/random.h"
#include "kinect_sim/camera_mount.h"
#include "kinect_sim/depth_renderer.h"
#include "kinect_sim/infrared_camera.h"
#include "kinect_sim/scene.h"

namespace knav {
namespace {

constexpr double kContactGap_m = 0.02;  ///< a contact is over when the gap has opened this much

}  // namespace

Pose2 FrameRequest::pose_at(double stamp) const {
  int i = 0;
  while (i + 2 < pose_count && T_world_base[static_cast<std::size_t>(i + 1)].stamp_s <= stamp) ++i;
  const StampedPose2& a = T_world_base[static_cast<std::size_t>(i)];
  if (pose_count < 2) return a.T_map_robot;
  const StampedPose2& b = T_world_base[static_cast<std::size_t>(i + 1)];
  const double t = std::clamp((stamp - a.stamp_s) / (b.stamp_s - a.stamp_s), 0.0, 1.0);
  return interpolate(a.T_map_robot, b.T_map_robot, t);
}

struct Simulator::Rendering {
  Rendering(const WorldConfig& world, const SimulatorConfig& config)
      : camera(kinect_camera()),
        meshes(world),
        scene(meshes),
        renderer(meshes, camera),
        kinect(KinectConfig::preset(config.sensor), camera, static_cast<std::uint64_t>(config.seed),
               static_cast<std::uint64_t>(config.device_seed)),
        z_m(static_cast<std::size_t>(camera.width_px)),
        signal(z_m.size()) {}
  PinholeModel camera;
  WorldMeshes meshes;
  Scene scene;
  DepthRenderer renderer;
  KinectModel kinect;
  std::vector<float> z_m, signal;
  std::unique_ptr<InfraredCamera> infrared;  // made when it is first looked through
};

Simulator::Simulator(const WorldConfig& world, const SimulatorConfig& config)
    : world_(world),
      config_(config),
      robot_(config.robot, OdometryErrors::preset(config.odometry), static_cast<std::uint64_t>(config.seed),
             static_cast<std::uint64_t>(config.device_seed)),
      collision_map_(world_, config.robot.height_m),
      crowd_(world_.people, collision_map_),
      truth_(512) {
  dynamic_.door_open_rad.resize(world_.doors.size());
  dynamic_.timed_solid_present.resize(world_.timed_solids.size());
  rendering_ = std::make_unique<Rendering>(world_, config_);
  robot_.set_pose(world_.spawn);
  crowd_.initial_state(&dynamic_.people);
  for (std::size_t i = 0; i < world_.doors.size(); ++i)
    dynamic_.door_open_rad[i] = door_open_at(world_.doors[i], 0.0);
  move_doors();
  truth_.add(stamp_s(), robot_.T_world_base());
  const double first_row_s = config_.stamp_row_px / 479.0 * config_.readout_s;
  next_frame_ = static_cast<std::uint64_t>(std::ceil(first_row_s * config_.frame_rate_hz));
}

Simulator::~Simulator() = default;

const PinholeModel& Simulator::camera() const { return rendering_->camera; }

Eigen::Isometry3d Simulator::T_base_camera() const {
  return camera_mount({config_.camera_forward_m, 0.0, config_.camera_height_m}, config_.camera_yaw_deg,
                      config_.camera_pitch_deg, config_.camera_roll_deg);
}

Eigen::Isometry3d Simulator::T_base_optical() const { return optical_frame(T_base_camera()); }

Pose2 Simulator::T_base_laser() const { return {config_.laser_forward_m, 0.0, 0.0}; }

double Simulator::stamp_s() const {
  return config_.start_time_s + static_cast<double>(steps_) * config_.step_s;
}

void Simulator::set_command(double v_mps, double w_radps) {
  robot_.set_command(v_mps, w_radps);
  command_step_ = steps_;
}

void Simulator::move_doors() {
  const double t = stamp_s() - config_.start_time_s;
  bool doors_moved = steps_ == 0, timed_changed = steps_ == 0;
  const Point2 robot{robot_.T_world_base().x_m, robot_.T_world_base().y_m};
  const double keep_off = config_.robot.radius_m + 0.05;
  for (std::size_t i = 0; i < world_.doors.size(); ++i) {
    const double open = door_open_at(world_.doors[i], t);
    if (open == dynamic_.door_open_rad[i]) continue;
    // A leaf waits for who stands in its way.
    if (footprint_distance_m(door_leaf(world_.doors[i], open), robot) < keep_off) continue;
    dynamic_.door_open_rad[i] = open;
    doors_moved = true;
  }
  for (std::size_t i = 0; i < world_.timed_solids.size(); ++i) {
    const TimedSolid& timed = world_.timed_solids[i];
    const char present = t >= timed.appears_s && t < timed.disappears_s;
    if (present == dynamic_.timed_solid_present[i]) continue;
    if (present && footprint_distance_m(timed.solid, robot) < keep_off) continue;
    dynamic_.timed_solid_present[i] = present;
    timed_changed = true;
  }
  if (doors_moved) collision_map_.set_doors(dynamic_.door_open_rad);
  if (timed_changed) collision_map_.set_timed(dynamic_.timed_solid_present);
}

double Simulator::gap_m(const Pose2& pose) const {
  const Point2 at{pose.x_m, pose.y_m};
  double clearance = collision_map_.clearance_m(at);
  for (const PersonState& person : dynamic_.people) {
    clearance = std::min(clearance, distance_m(person.T_world_person, pose) - person.radius_m);
  }
  // The wheels stand at six tenths of the radius; the rim may hang over a stair.
  const double over_stairs_m = collision_map_.stairs_distance_m(at) - 0.6 * config_.robot.radius_m;
  return std::min(clearance - config_.robot.radius_m, over_stairs_m);
}

std::string Simulator::nearest_thing() const {
  const Pose2& robot = robot_.T_world_base();
  double least = collision_map_.clearance_m({robot.x_m, robot.y_m});
  std::string name = "something solid";
  for (std::size_t i = 0; i < dynamic_.people.size(); ++i) {
    const PersonState& person = dynamic_.people[i];
    const double away = distance_m(person.T_world_person, robot) - person.radius_m;
    if (away >= least) continue;
    least = away;
    name = fmt::format("{} (at ({:.2f}, {:.2f}) m, {})", world_.people[i].name.empty() ? "somebody" : world_.people[i].name,
                       person.T_world_person.x_m, person.T_world_person.y_m,
                       person.speed_mps > 0.0 ? fmt::format("walking at {:.2f} m/s", person.speed_mps) : "standing");
  }
  if (collision_map_.stairs_distance_m({robot.x_m, robot.y_m}) + 0.4 * config_.robot.radius_m < least) name = "a stair's edge";
  return name;
}

void Simulator::step() {
  ++steps_;
  const double age_s = static_cast<double>(steps_ - command_step_) * config_.step_s;
  if (age_s > config_.robot.command_timeout_s) robot_.set_command(0.0, 0.0);
  move_doors();

  const Pose2 before = robot_.T_world_base();
  const Pose2 wanted = robot_.wanted_pose(config_.step_s, steps_);
  const double gap_before = gap_m(before), gap_after = gap_m(wanted);
  // A robot that stands, or turns on the spot, runs into nobody, whoever stands against it.
  const bool blocked = gap_after < 0.0 && gap_after < gap_before;
  if (blocked) {
    robot_.stay();
    if (!contacts_.touching) ++contacts_.collisions;
    contacts_.touching = true;
  } else {
    robot_.advance();
    if (gap_after > kContactGap_m) contacts_.touching = false;
  }
  distance_driven_m_ += distance_m(before, robot_.T_world_base());

  crowd_.step(stamp_s() - config_.start_time_s - reset_time_s_, config_.step_s, robot_.T_world_base(),
              robot_.v_mps(), config_.robot.radius_m, &dynamic_.people);
  // The robot's own contact is settled above, so whoever is nearer than touching now has walked there.
  if (!contacts_.touching && gap_m(robot_.T_world_base()) < 0.0) {
    ++contacts_.walker_contacts;
    contacts_.touching = true;
  }
  truth_.add(stamp_s(), robot_.T_world_base());
}

bool Simulator::next_frame(FrameRequest* request) {
  const double period = 1.0 / config_.frame_rate_hz;
  const double stamp = config_.start_time_s + static_cast<double>(next_frame_) * period;
  const double first_s = stamp - config_.stamp_row_px / 479.0 * config_.readout_s;
  const double last_s = first_s + config_.readout_s;
  if (stamp_s() < last_s) return false;
  request->index = next_frame_++;
  request->stamp_s = stamp;
  request->pose_count = static_cast<int>(request->T_world_base.size());
  for (std::size_t i = 0; i < request->T_world_base.size(); ++i) {
    StampedPose2& knot = request->T_world_base[i];
    knot.stamp_s = first_s + config_.readout_s * static_cast<double>(i) /
                                 static_cast<double>(request->T_world_base.size() - 1);
    if (truth_.at(knot.stamp_s, 1.0, config_.step_s, &knot.T_map_robot) != PoseBuffer::Lookup::kOk) {
      knot.T_map_robot = robot_.T_world_base();
    }
  }
  if (config_.readout_s <= 0.0) request->pose_count = 1;
  request->dynamic = dynamic_;
  return true;
}

void Simulator::request_now(FrameRequest* request) const {
  request->index = steps_;
  request->stamp_s = stamp_s();
  request->pose_count = 1;
  request->T_world_base[0] = {stamp_s(), robot_.T_world_base()};
  request->dynamic = dynamic_;
}

template <class Row>
void Simulator::for_each_row(const FrameRequest& request, DepthRenderer& renderer, int rows, const Row& row) {
  Rendering& r = *rendering_;
  const Eigen::Isometry3d mount = T_base_optical();
  const double row_s = config_.readout_s / (r.camera.height_px - 1);
  const double scale = static_cast<double>(r.camera.height_px) / rows;  // a row of an image of other size
  const auto optical = [&](int v) {
    const double image_row = (v + 0.5) * scale - 0.5;
    const Pose2 base = request.pose_at(request.stamp_s + (image_row - config_.stamp_row_px) * row_s);
    return Eigen::Isometry3f((isometry(base) * mount).cast<float>());
  };
  const int last = rows - 1;
  renderer.start_frame(request.dynamic, optical(0), optical(last));
  for (int v = 0; v <= last; ++v) row(v, optical(v));
}

void Simulator::render(const FrameRequest& request, cv::Mat* depth_mm) {
  Rendering& r = *rendering_;
  depth_mm->create(r.camera.height_px, r.camera.width_px, CV_16UC1);
  r.kinect.start_frame(request.index);
  for_each_row(request, r.renderer, r.camera.height_px, [&](int v, const Eigen::Isometry3f& T_world_optical) {
    r.renderer.render_row(T_world_optical, v, r.z_m.data(), r.signal.data());
    r.kinect.sense_row(v, {r.z_m.data(), r.signal.data()}, depth_mm->ptr<std::uint16_t>(v));
  });
}

PinholeModel Simulator::infrared_camera() const { return InfraredCamera::camera_of(rendering_->camera); }

void Simulator::render_infrared(const FrameRequest& request, cv::Mat* infrared) {
  Rendering& r = *rendering_;
  if (!r.infrared) {
    r.infrared = std::make_unique<InfraredCamera>(r.meshes, r.camera, static_cast<std::uint64_t>(config_.seed));
  }
  infrared->create(r.camera.height_px, r.camera.width_px, CV_16UC1);
  r.infrared->start_frame(request.index);
  for_each_row(request, r.infrared->renderer(), r.camera.height_px * InfraredCamera::kFine,
               [&](int v, const Eigen::Isometry3f& T_world_optical) {
                 r.infrared->take_row(T_world_optical, v, infrared->ptr<std::uint16_t>());
               });
}

void Simulator::render_true_depth(const FrameRequest& request, cv::Mat* depth_m) {
  Rendering& r = *rendering_;
  depth_m->create(r.camera.height_px, r.camera.width_px, CV_32FC1);
  for_each_row(request, r.renderer, r.camera.height_px, [&](int v, const Eigen::Isometry3f& T_world_optical) {
    float* out = depth_m->ptr<float>(v);
    r.renderer.render_row(T_world_optical, v, out, nullptr);
    for (int u = 0; u < r.camera.width_px; ++u) {
      if (!std::isfinite(out[u])) out[u] = std::numeric_limits<float>::quiet_NaN();
    }
  });
}

void Simulator::scan_lidar(const FrameRequest& request, RangeScan* scan) {
  constexpr int kRays = 361;
  constexpr double kNoise_m = 0.01;
  scan->stamp_s = request.stamp_s;
  scan->angle_min_rad = -kPi / 2;
  scan->angle_increment_rad = kPi / (kRays - 1);
  scan->range_min_m = 0.05;
  scan->range_max_m = 30.0;
  cast_scan(request, request.pose_at(request.stamp_s) * T_base_laser(), config_.laser_height_m, kRays, scan);
  RandomStream random(static_cast<std::uint64_t>(config_.seed), random_stream::kSimLidar, request.index, 0);
  for (float& range : scan->range_m) {
    const double noise = kNoise_m * random.normal();
    if (!std::isfinite(range)) continue;
    range = static_cast<float>(range + noise);
    if (range < scan->range_min_m) range = std::numeric_limits<float>::quiet_NaN();
    if (range >= scan->range_max_m) range = std::numeric_limits<float>::infinity();
  }
}

void Simulator::scan_perfect(const FrameRequest& request, double height_m, RangeScan* scan) {
  constexpr int kRays = 3600;
  scan->stamp_s = request.stamp_s;
  scan->angle_min_rad = -kPi;
  scan->angle_increment_rad = 2 * kPi / kRays;
  scan->range_min_m = 0.0;
  scan->range_max_m = 30.0;
  cast_scan(request, request.pose_at(request.stamp_s), height_m, kRays, scan);
}

float Simulator::range_ahead_m(const FrameRequest& request) {
  rendering_->scene.update(request.dynamic);
  const Eigen::Isometry3f T = (isometry(request.pose_at(request.stamp_s)) * T_base_optical()).cast<float>();
  return rendering_->scene.cast(T.translation(), T.linear().col(2), 50.0f);
}

void Simulator::cast_scan(const FrameRequest& request, const Pose2& T_world_sensor, double height_m, int rays,
                          RangeScan* scan) {
  rendering_->scene.update(request.dynamic);
  scan->range_m.resize(static_cast<std::size_t>(rays));
  scan->evidence.clear();
  const Eigen::Vector3f origin(static_cast<float>(T_world_sensor.x_m), static_cast<float>(T_world_sensor.y_m),
                               static_cast<float>(height_m));
  for (int i = 0; i < rays; ++i) {
    const double angle = T_world_sensor.yaw_rad + scan->angle_min_rad + i * scan->angle_increment_rad;
    const Eigen::Vector3f direction(static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)),
                                    0.0f);
    scan->range_m[static_cast<std::size_t>(i)] =
        rendering_->scene.cast(origin, direction, static_cast<float>(scan->range_max_m));
  }
}

void Simulator::set_pose(const Pose2& T_world_base, double room_m) {
  if (!is_finite(T_world_base)) throw UserError("set_pose: the pose is not finite.");
  if (gap_m(T_world_base) < room_m) {
    throw UserError(fmt::format("set_pose: the robot does not fit at [{:.2f}, {:.2f}] in world {}.",
                                T_world_base.x_m, T_world_base.y_m, world_.file));
  }
  robot_.set_pose(T_world_base);
  robot_.set_command(0.0, 0.0);
  contacts_.touching = false;
}

void Simulator::reset() {
  crowd_.reset();
  crowd_.initial_state(&dynamic_.people);
  reset_time_s_ = stamp_s() - config_.start_time_s;
  robot_.set_pose(world_.spawn);
  robot_.set_command(0.0, 0.0);
  contacts_ = ContactCount();
  distance_driven_m_ = 0.0;
}

}  // namespace knav
