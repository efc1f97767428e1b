#include "kinect_calib/live_wall.h"

#include <cv_bridge/cv_bridge.h>
#include <fmt/format.h>
#include <sensor_msgs/image_encodings.h>

#include <cmath>

#include "core/error.h"
#include "kinect_calib/calibration_view.h"
#include "kinect_calib/depth_messages.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

constexpr double kViewPeriod_s = 0.2;
constexpr double kInfraredStale_s = 2.0;

}  // namespace

LiveWall::LiveWall(const LiveTopics& topics, bool range_finder)
    : topics_(topics), corrector_(DepthCorrectionConfig{}) {
  info_subscriber_ = node_.subscribe<sensor_msgs::CameraInfo>(
      topics.info, 5, [this](const sensor_msgs::CameraInfoConstPtr& m) { camera_ = raw_camera_from(*m); });
  // One at a time: what is late is not worth looking at.
  depth_subscriber_ = node_.subscribe<sensor_msgs::Image>(topics.depth, 1, &LiveWall::on_image, this);
  odometry_subscriber_ =
      node_.subscribe<nav_msgs::Odometry>(topics.odometry, 50, [this](const nav_msgs::OdometryConstPtr& m) {
        input_.odometry_stamp_s = m->header.stamp.toSec();
        input_.T_odom_base = pose2_from(m->pose.pose);
      });
  if (range_finder) {
    range_subscriber_ = node_.subscribe<sensor_msgs::Range>(
        topics.range, 50, [this](const sensor_msgs::RangeConstPtr& m) { on_range(*m); });
  }
  view_publisher_ = node_.advertise<sensor_msgs::Image>("calibration_view", 1);
}

void LiveWall::on_range(const sensor_msgs::Range& message) {
  // Some drivers leave the limits at 0.
  const bool limits = message.max_range > message.min_range;
  const bool within = !limits || (message.range >= message.min_range && message.range <= message.max_range);
  input_.ranges_m.push_back(within ? static_cast<double>(message.range) : std::nan(""));
}

void LiveWall::on_image(const sensor_msgs::ImageConstPtr& message) {
  if (!camera_.raw.valid()) return;  // its camera_info is on the way
  cv::Mat view;
  std::string fault;
  if (!view_depth(*message, &view, &fault)) throw UserError(topics_.depth + ": " + fault);
  if (view.type() != CV_16UC1) {
    throw UserError(
        fmt::format("{}: has encoding '{}'; a calibration needs the sensor's own 16UC1 (mm): name its raw "
                    "topic with --depth-topic.",
                    topics_.depth, message->encoding));
  }
  if (!corrector_.correct(view, camera_, &depth_m_))
    throw UserError(topics_.depth + ": " + corrector_.fault());
  view.copyTo(raw_);
  const PinholeModel& rectified = camera_.rectified;
  if (!viewer_ || viewer_camera_.fx_px != rectified.fx_px || viewer_camera_.cx_px != rectified.cx_px ||
      viewer_camera_.width_px != rectified.width_px) {
    viewer_ = std::make_unique<WallViewer>(rectified);
    viewer_camera_ = rectified;
  }
  input_.wall = viewer_->look(depth_m_);
  input_.depth_stamp_s = message->header.stamp.toSec();
  input_.new_frame = true;
}

GuidedInput LiveWall::take(double now_s) {
  GuidedInput input = input_;
  input.now_s = now_s;
  input_.new_frame = false;
  input_.ranges_m.clear();
  return input;
}

void LiveWall::show(const std::vector<std::string>& lines) {
  if (view_publisher_.getNumSubscribers() == 0) {
    infrared_subscriber_.shutdown();
    infrared_info_subscriber_.shutdown();
    return;
  }
  const ros::WallTime now = ros::WallTime::now();
  if (!infrared_subscriber_) {
    infrared_info_subscriber_ = node_.subscribe<sensor_msgs::CameraInfo>(
        topics_.infrared_info, 1, [this](const sensor_msgs::CameraInfoConstPtr& m) { infrared_info_ = m; });
    infrared_subscriber_ =
        node_.subscribe<sensor_msgs::Image>(topics_.infrared, 1, [this](const sensor_msgs::ImageConstPtr& m) {
          infrared_ = m;
          infrared_came_ = ros::WallTime::now();
        });
  }
  if ((now - shown_).toSec() < kViewPeriod_s) return;
  shown_ = now;
  cv::Mat picture;
  if (infrared_ && (now - infrared_came_).toSec() < kInfraredStale_s) {
    try {
      const PinholeModel& depth = camera_.raw;
      const cv::Mat image = cv_bridge::toCvShare(infrared_)->image;
      // Without camera_info the cross is where the depth image has its own.
      const double u_px = infrared_info_ ? infrared_info_->K[2] : depth.cx_px;
      const double v_px = infrared_info_ ? infrared_info_->K[5] : depth.cy_px;
      picture = infrared_view(image, u_px, v_px, lines);
    } catch (const cv::Exception& error) {
      throw UserError(fmt::format("{}: an image cannot be read: {}", topics_.infrared, error.what()));
    } catch (const cv_bridge::Exception& error) {
      throw UserError(fmt::format("{}: an image cannot be read: {}", topics_.infrared, error.what()));
    }
  } else if (!depth_m_.empty()) {
    picture = deviation_view(depth_m_, camera_.rectified, input_.wall.plane, lines);
  } else {
    return;
  }
  std_msgs::Header header;
  header.stamp = ros::Time::now();
  view_publisher_.publish(
      cv_bridge::CvImage(header, sensor_msgs::image_encodings::BGR8, picture).toImageMsg());
}

}  // namespace knav
