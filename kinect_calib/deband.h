#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace knav {

/// Paper section III.B: the sensor's vertical bands (constant offsets of whole groups of columns, which move
/// with scene and distance) must not be learned. Finds the steps between bands along the horizontal and takes
/// them out, keeping the frame-wide mean; what changes smoothly across the image, the error to be learned,
/// stays. Only steps well above the frame's own noise count: a step invented does more harm than one left in.
class Debander {
 public:
  /// @param depth_m 32FC1 m of a flat wall, NaN invalid; corrected in place
  /// @return number of steps found
  int remove_bands(cv::Mat* depth_m);
  /// Of the newest image: the reading jumps by this much from the column before to this one.
  struct Step {
    int column;
    double step_per_m;
  };
  const std::vector<Step>& steps() const { return steps_; }

 private:
  void average_columns(const cv::Mat& depth_m, int first_row, int last_row);
  void measure_steps(const cv::Mat& depth_m);
  void keep_smooth_part();

  double error_per_m_ = 0.0;
  std::vector<double> column_per_m_, step_per_m_, band_per_m_;
  std::vector<Step> steps_;
  std::vector<float> values_;
};

}  // namespace knav
