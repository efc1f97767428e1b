#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace knav {

/// Finds the nearest surface of every column that enough rows support. The smallest of hundreds of noisy
/// readings lies some standard deviations before the wall, a bias that grows with range squared; single
/// flying pixels lie anywhere; and what is too far for the sensor answers with anything.
class ColumnSurface {
 public:
  /// @param support_rows readings that must lie within one window of each other to be a surface
  /// @param window_per_m the window in inverse depth [1/m]: a few disparity codes
  /// @param range_max_m  readings farther than this do not exist
  void configure(int support_rows, double window_per_m, double range_max_m);

  /// Both would find the same in the same image.
  bool finds_the_same(const ColumnSurface& other) const {
    return support_rows_ == other.support_rows_ && window_per_m_ == other.window_per_m_ &&
           range_max_m_ == other.range_max_m_;
  }

  /// After this nearest_m() has, per column, the nearest reading of the nearest supported surface (NaN:
  /// none), and window_end_m() where the window behind it ends.
  /// @param fy_px the camera's: how many rows a height takes up
  void find(const cv::Mat& sliced, double fy_px);
  /// Takes over what `other` found.
  void take(const ColumnSurface& other) {
    nearest_m_ = other.nearest_m_;
    window_end_m_ = other.window_end_m_;
    sum_ = other.sum_;
    count_ = other.count_;
  }
  const std::vector<float>& nearest_m() const { return nearest_m_; }
  const std::vector<float>& window_end_m() const { return window_end_m_; }

  /// Mean in inverse depth of the readings in the window [m] of what was found or taken over; NaN: no surface.
  void average(std::vector<float>* z_m) const;
  /// How many readings of each column lie in that window; 255: that many or more.
  void count_rows(std::vector<std::uint8_t>* rows) const;
  /// The plain minimum of each column (paper).
  static void minimum(const cv::Mat& sliced, double range_max_m, std::vector<float>* z_m);

 private:
  void sum_windows(const cv::Mat& sliced);
  void drop_doubtful(float fy_px);
  void find_in_strip(const cv::Mat& sliced, int first_column);
  float first_supported(const float* sorted) const;
  float window_end(float nearest_m) const;

  int support_rows_ = 3;
  float window_per_m_ = 0.01f;
  float range_max_m_ = 20.0f;
  std::vector<float> nearest_m_, window_end_m_;
  std::vector<float> sum_, count_;  ///< of inverse depth [1/m], over the readings in the window
  std::vector<float> beyond_;       ///< how many readings lie beyond the range
  cv::Mat narrow_;
};

}  // namespace knav
