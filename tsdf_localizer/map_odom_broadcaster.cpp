#include "tsdf_localizer/map_odom_broadcaster.h"

#include "ros_common/conversions.h"

namespace knav {

void MapOdomBroadcaster::send(const ros::Time& now) {
  if (!known_ || now.isZero() || now <= last_sent_) return;
  T_published_ = last_sent_.isZero() ? T_map_odom_ : slewed(T_published_, T_map_odom_, T_odom_base_, (now - last_sent_).toSec(), limit_);
  geometry_msgs::TransformStamped message;
  message.header.stamp = now + tolerance_;
  message.header.frame_id = map_frame_;
  message.child_frame_id = odom_frame_;
  message.transform = transform_message(T_published_);
  broadcaster_.sendTransform(message);
  last_sent_ = now;
}

}  // namespace knav
