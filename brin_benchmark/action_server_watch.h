#pragma once

#include <actionlib_msgs/GoalID.h>
#include <actionlib_msgs/GoalStatusArray.h>
#include <ros/node_handle.h>
#include <ros/single_subscriber_publisher.h>

#include <mutex>
#include <string>

namespace knav {

/// Notices that an action's server ends, even if another one of the same name takes its place before anybody asks:
/// to the action's client such a change is no event, and it waits for good for a goal that the new one never heard of.
class ActionServerWatch {
 public:
  ActionServerWatch(ros::NodeHandle handle, const std::string& action);
  /// How often a server of this action went away so far.
  int departures() const;

 private:
  void on_status(const ros::MessageEvent<const actionlib_msgs::GoalStatusArray>& event);
  void on_disconnect(const ros::SingleSubscriberPublisher& subscriber);

  mutable std::mutex mutex_;
  std::string server_;  ///< the node that sends the action's status
  int departures_ = 0;
  ros::Publisher cancel_;  ///< sends nothing: its connection to the server is what is watched
  ros::Subscriber status_;
};

}  // namespace knav
