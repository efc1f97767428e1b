#pragma once

#include <geometry_msgs/TransformStamped.h>

#include <Eigen/Geometry>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace knav {

/// The fixed transforms of a recording: the first value seen of every child frame. Names without a leading
/// slash.
class FixedTransforms {
 public:
  void add(const geometry_msgs::TransformStamped& transform);
  /// The newest value instead of the first; false if the transform is no good.
  bool replace(const geometry_msgs::TransformStamped& transform);
  /// T_parent_child over any chain of frames; false if none joins the two.
  bool find(const std::string& parent, const std::string& child, Eigen::Isometry3d* T_parent_child) const;

 private:
  struct Link {
    std::string parent;
    Eigen::Isometry3d T_parent_child;
  };
  std::map<std::string, Link> link_of_child_;
};

/// A mount that moves against the base, as a hand-held camera's does: one transform a stamp.
class MovingTransform {
 public:
  /// Stamps must not fall.
  void add(double stamp_s, const Eigen::Isometry3d& T_base_sensor);
  bool empty() const { return stamped_.empty(); }
  /// The one nearest in time.
  const Eigen::Isometry3d& at(double stamp_s) const;

 private:
  std::vector<std::pair<double, Eigen::Isometry3d>> stamped_;
};

std::string without_leading_slash(const std::string& name);

}  // namespace knav
