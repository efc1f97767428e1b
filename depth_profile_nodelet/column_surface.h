#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace knav {

/// Finds the nearest surface of every column that enough rows support. The smallest of hundreds of noisy
/// readings lies some standard deviations before the wall, a bias that grows with range squared; single
/// flying pixels lie anywhere.
class ColumnSurface {
 public:
  /// @param support_rows readings that must lie within one window of each other to be a surface
  /// @param window_per_m the window in inverse depth [1/m]: a few disparity codes
  /// @param range_max_m  readings farther than this do not exist
  void configure(int support_rows, double window_per_m, double range_max_m);

  /// After this nearest_m() has, per column, the nearest reading of the nearest supported surface (NaN:
  /// none), and window_end_m() where the window behind it ends.
  void find(const cv::Mat& sliced);
  const std::vector<float>& nearest_m() const { return nearest_m_; }
  const std::vector<float>& window_end_m() const { return window_end_m_; }

  /// Mean in inverse depth of the readings in the window [m]; NaN: no surface.
  void average(const cv::Mat& sliced, std::vector<float>* z_m);
  /// The plain minimum of each column (paper).
  static void minimum(const cv::Mat& sliced, double range_max_m, std::vector<float>* z_m);

 private:
  float first_supported(const float* sorted) const;
  float window_end(float nearest_m) const;

  int support_rows_ = 3;
  float window_per_m_ = 0.01f;
  float range_max_m_ = 20.0f;
  std::vector<float>
      smallest_;  // the eight smallest readings of each column: eight rows, sorted down the rows
  std::vector<float> nearest_m_, window_end_m_, beyond_m_, first_m_, sum_, count_;
};

}  // namespace knav
