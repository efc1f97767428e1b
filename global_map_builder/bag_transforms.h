#pragma once

#include <geometry_msgs/TransformStamped.h>

#include <Eigen/Geometry>
#include <map>
#include <string>

namespace knav {

/// The fixed transforms of a recording: the first value seen of every child frame. Names without a leading slash.
class FixedTransforms {
 public:
  void add(const geometry_msgs::TransformStamped& transform);
  /// T_parent_child over any chain of frames; false if none joins the two.
  bool find(const std::string& parent, const std::string& child, Eigen::Isometry3d* T_parent_child) const;

 private:
  struct Link {
    std::string parent;
    Eigen::Isometry3d T_parent_child;
  };
  std::map<std::string, Link> link_of_child_;
};

std::string without_leading_slash(const std::string& name);

}  // namespace knav
