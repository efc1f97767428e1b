#pragma once

#include <ros/ros.h>

#include <functional>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace knav {

/// Holds a nodelet's subscriptions only while somebody listens to what it makes of them.
class OnDemand {
 public:
  /// @param subscribe   called when the first listener comes
  /// @param unsubscribe called when the last one has gone
  OnDemand(std::function<void()> subscribe, std::function<void()> unsubscribe)
      : subscribe_(std::move(subscribe)), unsubscribe_(std::move(unsubscribe)) {}

  template <class Message>
  ros::Publisher advertise(ros::NodeHandle& node, const std::string& topic, std::uint32_t queue_size) {
    const auto check = [this](const ros::SingleSubscriberPublisher&) { update(); };
    const std::lock_guard<std::mutex> lock(mutex_);
    publishers_.push_back(node.advertise<Message>(topic, queue_size, check, check));
    return publishers_.back();
  }

 private:
  void update() {
    const std::lock_guard<std::mutex> lock(mutex_);
    bool wanted = false;
    for (const ros::Publisher& publisher : publishers_) wanted = wanted || publisher.getNumSubscribers() > 0;
    if (wanted != subscribed_) (wanted ? subscribe_ : unsubscribe_)();
    subscribed_ = wanted;
  }

  std::function<void()> subscribe_, unsubscribe_;
  std::mutex mutex_;
  std::vector<ros::Publisher> publishers_;
  bool subscribed_ = false;
};

}  // namespace knav
