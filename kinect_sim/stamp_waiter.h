#pragma once

#include <ros/node_handle.h>
#include <topic_tools/shape_shifter.h>

#include <condition_variable>
#include <mutex>

namespace knav {

/// The stamp of a message of any type that begins with a header; false if it does not.
bool header_stamp(const topic_tools::ShapeShifter& message, double* stamp_s);

/// Waits for a message of any type with a header to arrive with a given stamp.
class StampWaiter {
 public:
  StampWaiter(ros::NodeHandle& handle, const std::string& topic);

  /// Until a stamp not older than this one has come, or the limit has passed (then false).
  bool wait_for(double stamp_s, double limit_s);
  void stop();

 private:
  void on_message(const topic_tools::ShapeShifter::ConstPtr& message);

  ros::Subscriber subscriber_;
  std::mutex mutex_;
  std::condition_variable arrived_;
  double newest_s_ = 0.0;
  bool stopped_ = false;
};

}  // namespace knav
