#pragma once

#include <Eigen/Core>
#include <vector>

#include "global_map_builder/drive.h"
#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/range_offset.h"

namespace knav {

/// A piece of surface that one frame saw.
struct ViewPoint {
  double column_share = 0.0;  ///< where across the image, 0 ... 1
  double depth_m = 0.0;       ///< as read: along the axis of a depth camera, along the ray of a scanner
  Eigen::Vector2d direction;  ///< times depth_m: the point in the sensor's frame
  bool valid = false;         ///< the point ...
  bool straight = false;      ///< ... and the surface round it, which has a normal
  // In the keyframe's frame:
  Eigen::Vector2d position, normal;
  Eigen::Vector2d on_line;  ///< the point as the straight surface round it has it, less noisy
  Eigen::Vector2d per_offset;  ///< how the position changes with the offset of its column
  double sd_m = 0.0;           ///< along the normal
  double range_m = 0.0;
};

/// What was seen at a keyframe as points of surfaces, a bin of neighbouring columns each.
class DriveView {
 public:
  /// `keyframe` of `drive`; empty if no frame was kept near it. Of a depth camera, the frames up to merge_m and merge_deg away
  /// are averaged.
  DriveView(const JointRefinementConfig& config, const Drive& drive, int keyframe);

  bool empty() const { return points_.empty(); }
  bool depth_camera() const { return pinhole_; }
  /// The sensor, in the keyframe's frame.
  Eigen::Vector2d eye() const { return {T_keyframe_sensor_.x_m, T_keyframe_sensor_.y_m}; }
  const std::vector<ViewPoint>& points() const { return points_; }
  /// Points and normals with this offset taken out.
  void place(const RangeOffset& offset);
  /// The bin that looks at a point of the keyframe's frame, -1 if none does.
  int bin_of(const Eigen::Vector2d& point) const {
    const Eigen::Vector2d in_sensor = R_sensor_keyframe_ * (point - eye());
    return bin_at({in_sensor.x(), in_sensor.y()});
  }

 private:
  DriveView() = default;
  void fill(const DepthProfile& profile);
  void fill(const RangeScan& scan);
  int bin_at(const Point2& in_sensor) const;
  void average(const JointRefinementConfig& config, const std::vector<DriveFrame>& frames, std::size_t own);
  void find_normals();
  void find_normal(std::size_t point, int reach_bins);

  void set_sensor(const Pose2& T_keyframe_sensor);

  Pose2 T_keyframe_sensor_;
  Eigen::Matrix2d R_sensor_keyframe_ = Eigen::Matrix2d::Identity();  ///< its turn, taken once: bin_of is asked millions of times
  bool pinhole_ = true;
  double fx_px_ = 1.0, cx_px_ = 0.0, angle_min_rad_ = 0.0, angle_increment_rad_ = 1.0;
  double bin_columns_ = 1.0;
  int reach_bins_ = 1;  ///< neighbours on either side that a normal is fitted to
  double far_m_ = 1.0;
  std::vector<ViewPoint> points_;
};

}  // namespace knav
