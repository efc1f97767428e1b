#pragma once

#include <opencv2/core.hpp>

#include "kinect_sim/world.h"

namespace knav {

/// A plan of a world. Pixel (0, 0) is the upper left corner; north (y) is up.
class WorldPicture {
 public:
  explicit WorldPicture(const WorldConfig& world, double pixels_per_m = 40.0);

  /// Solids by height, stairs, glass, doors, paths of people, places.
  void draw_world();
  /// Only what stands in a slice of heights, in light grey.
  void draw_slice(double low_m, double high_m);
  void draw_point(const Point2& p, const cv::Scalar& bgr, int radius_px);
  void draw_path(const std::vector<Point2>& path, const cv::Scalar& bgr);
  const cv::Mat& image() const { return image_; }

 private:
  cv::Point pixel(const Point2& p) const;
  void fill(const Solid& solid, const cv::Scalar& bgr);

  const WorldConfig& world_;
  double scale_;
  cv::Mat image_;
};

/// Depth [mm] in colours, 0 black, up to `far_m`.
cv::Mat depth_picture(const cv::Mat& depth_mm, double far_m);

}  // namespace knav
