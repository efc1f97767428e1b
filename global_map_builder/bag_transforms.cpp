#include "global_map_builder/bag_transforms.h"

#include <algorithm>

namespace knav {

std::string without_leading_slash(const std::string& name) {
  return name.substr(!name.empty() && name[0] == '/');
}

void FixedTransforms::add(const geometry_msgs::TransformStamped& transform) {
  if (link_of_child_.count(without_leading_slash(transform.child_frame_id)) == 0) replace(transform);
}

bool FixedTransforms::replace(const geometry_msgs::TransformStamped& transform) {
  const auto& t = transform.transform.translation;
  const auto& q = transform.transform.rotation;
  const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
  if (!(rotation.norm() > 0.5)) return false;  // also NaN
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotation.normalized().toRotationMatrix();
  T.translation() = Eigen::Vector3d(t.x, t.y, t.z);
  if (!T.translation().allFinite()) return false;
  link_of_child_[without_leading_slash(transform.child_frame_id)] = {
      without_leading_slash(transform.header.frame_id), T};
  return true;
}

void MovingTransform::add(double stamp_s, const Eigen::Isometry3d& T_base_sensor) {
  if (stamped_.empty() || stamp_s > stamped_.back().first) stamped_.emplace_back(stamp_s, T_base_sensor);
}

const Eigen::Isometry3d& MovingTransform::at(double stamp_s) const {
  auto after = std::lower_bound(stamped_.begin(), stamped_.end(), stamp_s,
                                [](const auto& entry, double stamp) { return entry.first < stamp; });
  if (after == stamped_.end()) return stamped_.back().second;
  if (after == stamped_.begin()) return after->second;
  const auto before = after - 1;
  return stamp_s - before->first < after->first - stamp_s ? before->second : after->second;
}

bool FixedTransforms::find(const std::string& parent, const std::string& child, Eigen::Isometry3d* T) const {
  // All ancestors of `parent` with their transform to it, then climb from `child` until one of them is met.
  std::map<std::string, Eigen::Isometry3d> T_parent_of;
  std::string frame = without_leading_slash(parent);
  Eigen::Isometry3d T_here = Eigen::Isometry3d::Identity();
  while (T_parent_of.emplace(frame, T_here).second) {
    const auto link = link_of_child_.find(frame);
    if (link == link_of_child_.end()) break;
    T_here = T_here * link->second.T_parent_child.inverse();
    frame = link->second.parent;
  }
  frame = without_leading_slash(child);
  Eigen::Isometry3d T_frame_child = Eigen::Isometry3d::Identity();
  for (std::size_t steps = 0; steps <= link_of_child_.size(); ++steps) {
    const auto met = T_parent_of.find(frame);
    if (met != T_parent_of.end()) {
      *T = met->second * T_frame_child;
      return true;
    }
    const auto link = link_of_child_.find(frame);
    if (link == link_of_child_.end()) return false;
    T_frame_child = link->second.T_parent_child * T_frame_child;
    frame = link->second.parent;
  }
  return false;
}

}  // namespace knav
