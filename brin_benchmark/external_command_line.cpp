#include "brin_benchmark/external_command_line.h"

#include <fmt/format.h>

#include "core/error.h"

namespace knav {
namespace {

const char* const kHelp =
    "with --config external: a stack with a move_base action, as ROS nodes, drives the runs (docs/benchmark.md, Other stacks)";

}  // namespace

CLI::Option_group* add_external_options(CLI::App* app, ExternalOptions* external, SessionOptions* session) {
  CLI::Option_group* group = app->add_option_group("Other stacks", kHelp);
  group->add_option("--rate", external->rate, "simulated seconds in a wall second; 0 = as fast as the stack follows")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  group
      ->add_option("--wait-topic", external->wait_topic,
                   "time waits for this topic's stamps, at any rate; else, with --rate 0, for those of TF map -> odom")
      ->type_name("TOPIC");
  group
      ->add_option("--lead", external->lead_s,
                   "where time waits: simulated time before the stack's newest pose and velocity command [s]")
      ->check(CLI::Range(0.02, 10.0))
      ->capture_default_str();
  group->add_flag("--lidar", external->lidar, "publishes a LIDAR's `scan` (180 deg, 361 rays, 30 m, 10 Hz, frame laser)");
  group
      ->add_option("--goals", session->goals,
                   "places.yaml with the waypoints' poses, and `start`, in a map of your own instead of OUT/map")
      ->check(CLI::ExistingFile);
  group->add_option("--ready-within", external->ready_within_s, "wall time the stack has to offer move_base and cmd_vel [s]")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  return group;
}

void check_external_options(const CLI::Option_group& group, const SessionOptions& session) {
  if (!session.external) {
    for (const CLI::Option* option : group.get_options()) {
      if (option->count() > 0)
        throw UserError(option->get_name() + " is for --config external; see --help.");
    }
    return;
  }
  if (session.jobs > 1) throw UserError("--jobs: one stack drives one run at a time; give each run a ROS master of its own.");
}

std::string external_next_steps(const SessionOptions& session) {
  return fmt::format(
      "The map is {0}/map (map_server: {0}/map/map.yaml; its origin is where the robot starts), the waypoints are in "
      "{0}/waypoints.json.\nGo on with\n"
      "  roscore &  rosparam set use_sim_time true\n"
      "  your stack on that map: sensors, odom, TF and /clock come from the benchmark, cmd_vel goes to it\n"
      "  this command again, without --map-only\n",
      session.out);
}

}  // namespace knav
