#include "tsdf_localizer/map_odom_broadcaster.h"

#include "ros_common/conversions.h"

namespace knav {

void MapOdomBroadcaster::send(const ros::Time& now) {
  if (!known_ || now.isZero() || now <= last_sent_) return;
  geometry_msgs::TransformStamped message;
  message.header.stamp = now + tolerance_;
  message.header.frame_id = map_frame_;
  message.child_frame_id = odom_frame_;
  message.transform = transform_message(T_map_odom_);
  broadcaster_.sendTransform(message);
  last_sent_ = now;
}

}  // namespace knav
