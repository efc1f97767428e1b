#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <opencv2/core.hpp>
#include <string>

#include "kinect_calib/rectification.h"

namespace knav {

/// A view of a depth image message's pixels, not a copy. @return false if it is no depth image or its fields
/// do not agree (size, step, encoding, byte order); `fault` then says why in a sentence
bool view_depth(const sensor_msgs::Image& message, cv::Mat* view, std::string* fault);

/// Makes `message` a 32FC1 image of that size, with the header given, and returns a view to write its pixels
/// into.
cv::Mat make_depth_message(const std_msgs::Header& header, int width_px, int height_px,
                           sensor_msgs::Image* message);

/// K, D and P; P is K where the message has none.
RawCamera raw_camera_from(const sensor_msgs::CameraInfo& info);

/// The camera_info of the rectified image: D zero, K and P the ideal camera, R the identity.
void rectified_info(const sensor_msgs::CameraInfo& raw, const PinholeModel& rectified,
                    sensor_msgs::CameraInfo* info);

}  // namespace knav
