#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "kinect_sim/kinect_model.h"
#include "sensor_benchmark/sensor_statistics.h"

namespace knav {

/// The simulated Kinect before the flat pieces of real frames, each where it was seen: noise depends on how a
/// surface slants, so that a room built anew would be compared by what stands in it.
class FlatPieceTwins {
 public:
  /// @param camera of the real frames
  FlatPieceTwins(KinectConfig kinect, const PinholeModel& camera, std::uint64_t seed,
                 std::uint64_t device_seed);
  /// Pieces that overlap come in frames of their own.
  /// @param visit is given a frame with nothing but pieces, 32FC1 m, NaN = invalid
  void sense(const std::vector<SensorStatistics::FlatPiece>& pieces,
             const std::function<void(const cv::Mat& depth_m)>& visit);

 private:
  void sense_frame(const cv::Mat& true_m, cv::Mat* depth_m);

  PinholeModel camera_;
  KinectModel kinect_;
  std::uint64_t frame_ = 0;
};

}  // namespace knav
