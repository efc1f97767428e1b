#pragma once

#include <ros/time.h>

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/guided_calibration.h"
#include "kinect_calib/live_outputs.h"
#include "kinect_calib/live_wall.h"
#include "kinect_calib/terminal_prompt.h"
#include "kinect_calib/wall_folder.h"

namespace knav {

/// Joins the robot, the guide, the folder and the person at the terminal.
class LiveCalibration {
 public:
  /// @param device name to note in the folder's camera_info.yaml
  LiveCalibration(const LiveTopics& topics, const std::string& device, const GuidedCalibrationConfig& config,
                  const GuidedStart& start, WallFolder* folder, TerminalPrompt* prompt);

  /// @return false after Ctrl-C. UserError if it had to give up. The robot is told to stop in any case.
  bool run();

 private:
  void watch_clock();
  bool one_step();
  std::optional<double> typed();
  void announce(const GuidedStep& step);
  std::string line_of(const GuidedStep& step) const;
  void keep(const GuidedDistance& finished);

  const std::string device_;
  LiveWall wall_;
  Commander commander_;
  StatusLine status_;
  GuidedCalibration guide_;
  WallFolder& folder_;
  TerminalPrompt& prompt_;
  DepthCorrector corrector_;
  GuidedState state_ = GuidedState::kWait;
  std::vector<cv::Mat> kept_;
  cv::Mat depth_m_;
  std::string last_;
  ros::Time clock_;
  ros::WallTime clock_moved_ = ros::WallTime::now();
};

}  // namespace knav
