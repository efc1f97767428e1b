#include "kinect_sim/tour_recorder.h"

#include <fmt/format.h>
#include <rosbag/bag.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/Range.h>
#include <std_msgs/Empty.h>
#include <tf2_msgs/TFMessage.h>

#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/progress.h"
#include "kinect_sim/sim_messages.h"
#include "ros_common/conversions.h"
#include "ros_common/program.h"

namespace knav {
namespace {

/// Writes one simulated robot's topics.
class Recorder {
 public:
  Recorder(Simulator& simulator, const RecordingOptions& options, rosbag::Bag* bag)
      : simulator_(simulator), options_(options), bag_(bag) {
    prepare_depth_message(simulator.camera(), &image_);
    tf_static_.transforms = mount_transforms(simulator);
    write("/tf_static", simulator.stamp_s(), tf_static_);
  }

  void odometry() {
    if (!bag_) return;
    const double now_s = simulator_.stamp_s();
    write("/odom", now_s, odometry_message(simulator_));
    tf2_msgs::TFMessage tf;
    tf.transforms.push_back(odometry_transform(simulator_));
    write("/tf", now_s, tf);
    write("/ground_truth", now_s, ground_truth_message(simulator_));
  }

  void mark() { write("/mark_place", simulator_.stamp_s(), std_msgs::Empty()); }

  /// True if a depth image was written.
  bool frame(const FrameRequest& request) {
    if (!bag_) return false;
    const double now_s = simulator_.stamp_s();
    const bool standing = std::abs(simulator_.robot().v_mps()) < 1e-3 && std::abs(simulator_.robot().w_radps()) < 1e-3;
    const bool with_depth = request.stamp_s - simulator_.config().start_time_s < options_.depth_s &&
                            (standing || !options_.depth_standing_only);
    if (with_depth) {
      image_.header.stamp.fromSec(request.stamp_s);
      cv::Mat view = depth_view(&image_);
      simulator_.render(request, &view);
      write("/camera/depth/image_raw", now_s, image_);
      write("/camera/depth/camera_info", now_s, camera_info_message(simulator_.camera(), request.stamp_s));
    }
    if (request.index % 3 != 0) return with_depth;
    if (options_.lidar) {
      simulator_.scan_lidar(request, &scan_);
      sensor_msgs::LaserScan message;
      scan_message(scan_, &message);
      message.header.frame_id = "laser";
      write("/lidar_scan", now_s, message);
    }
    if (options_.range) write("/range", now_s, range_message(simulator_, request));
    return with_depth;
  }

 private:
  template <class Message>
  void write(const char* topic, double stamp_s, const Message& message) {
    if (bag_) bag_->write(topic, ros::Time(stamp_s), message);
  }

  Simulator& simulator_;
  RecordingOptions options_;
  rosbag::Bag* bag_;
  sensor_msgs::Image image_;
  tf2_msgs::TFMessage tf_static_;
  RangeScan scan_;
};

}  // namespace

TourResult run_tour(Simulator& simulator, const TourScript& script, double odom_rate_hz, double limit_s,
                    const TourObserver& observer) {
  TourResult result;
  TourDriver driver(script);
  Progress progress("simulate");
  FrameRequest request;
  const double start_s = simulator.stamp_s();
  const auto every = static_cast<int>(std::max(1L, std::lround(1.0 / (odom_rate_hz * simulator.config().step_s))));
  while (true) {
    const TourDriver::Command command = driver.step(simulator.stamp_s(), simulator.T_world_base());
    if (observer.odometry) observer.odometry();
    result.truth.push_back({simulator.stamp_s(), simulator.T_world_base()});
    result.odometry.push_back({simulator.stamp_s(), simulator.T_odom_base()});
    if (command.done || simulator.stamp_s() - start_s >= limit_s) break;
    if (command.mark) {
      result.marks.push_back(*command.mark);
      if (observer.mark) observer.mark(*command.mark);
    }
    if (command.stuck) {
      const Pose2& at = simulator.T_world_base();
      throw NoHeadway(
          fmt::format("{}: the robot makes no headway at [{:.2f}, {:.2f}] in {}; change the script there.",
                      script.file, at.x_m, at.y_m, simulator.world().file));
    }
    simulator.set_command(command.v_mps, command.w_radps);
    for (int i = 0; i < every; ++i) {
      simulator.step();
      if (simulator.next_frame(&request) && observer.frame && observer.frame(request)) ++result.depth_frames;
    }
    stop_if_interrupted();
    progress.update(driver.progress(), fmt::format("{:.0f} s, {:.1f} m", simulator.stamp_s() - start_s,
                                                   simulator.distance_driven_m()));
  }
  progress.update(1.0);
  result.duration_s = simulator.stamp_s() - start_s;
  result.distance_m = simulator.distance_driven_m();
  result.contacts = simulator.contacts();
  return result;
}

TourResult run_tour(Simulator& simulator, const TourScript& script, const RecordingOptions& options,
                    rosbag::Bag* bag) {
  Recorder recorder(simulator, options, bag);
  TourObserver observer;
  observer.odometry = [&] { recorder.odometry(); };
  observer.mark = [&](const std::string&) { recorder.mark(); };
  observer.frame = [&](const FrameRequest& request) { return recorder.frame(request); };
  return run_tour(simulator, script, options.odom_rate_hz, std::numeric_limits<double>::infinity(), observer);
}

}  // namespace knav
