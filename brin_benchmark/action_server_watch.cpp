#include "brin_benchmark/action_server_watch.h"

namespace knav {

ActionServerWatch::ActionServerWatch(ros::NodeHandle handle, const std::string& action) {
  cancel_ = handle.advertise<actionlib_msgs::GoalID>(
      action + "/cancel", 1, [](const ros::SingleSubscriberPublisher&) {},
      [this](const ros::SingleSubscriberPublisher& subscriber) { on_disconnect(subscriber); });
  status_ = handle.subscribe(action + "/status", 1, &ActionServerWatch::on_status, this);
}

int ActionServerWatch::departures() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return departures_;
}

void ActionServerWatch::on_status(const ros::MessageEvent<const actionlib_msgs::GoalStatusArray>& event) {
  const std::lock_guard<std::mutex> lock(mutex_);
  server_ = event.getPublisherName();
}

void ActionServerWatch::on_disconnect(const ros::SingleSubscriberPublisher& subscriber) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (subscriber.getSubscriberName() == server_) ++departures_;
}

}  // namespace knav
