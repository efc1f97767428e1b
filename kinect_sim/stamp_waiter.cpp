#include "kinect_sim/stamp_waiter.h"

#include <chrono>
#include <vector>

namespace knav {

bool header_stamp(const topic_tools::ShapeShifter& message, double* stamp_s) {
  if (message.getMessageDefinition().find("Header header") == std::string::npos || message.size() < 12) {
    ROS_ERROR_ONCE("%s has no header, so its stamps cannot be waited for; choose another topic to wait for.",
                   message.getDataType().c_str());
    return false;
  }
  std::vector<std::uint8_t> bytes(message.size());
  ros::serialization::OStream out(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  message.write(out);
  ros::serialization::IStream in(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  std::uint32_t sequence = 0;
  ros::Time stamp;
  in.next(sequence);
  in.next(stamp);
  *stamp_s = stamp.toSec();
  return true;
}

StampWaiter::StampWaiter(ros::NodeHandle& handle, const std::string& topic)
    : subscriber_(handle.subscribe<topic_tools::ShapeShifter>(
          topic, 10, [this](const topic_tools::ShapeShifter::ConstPtr& message) { on_message(message); })) {}

void StampWaiter::on_message(const topic_tools::ShapeShifter::ConstPtr& message) {
  double stamp_s = 0.0;
  if (!header_stamp(*message, &stamp_s)) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  newest_s_ = std::max(newest_s_, stamp_s);
  arrived_.notify_all();
}

bool StampWaiter::wait_for(double stamp_s, double limit_s) {
  std::unique_lock<std::mutex> lock(mutex_);
  return arrived_.wait_for(lock, std::chrono::duration<double>(limit_s),
                           [&] { return stopped_ || newest_s_ > stamp_s - 1e-6; });
}

void StampWaiter::stop() {
  const std::lock_guard<std::mutex> lock(mutex_);
  stopped_ = true;
  arrived_.notify_all();
}

}  // namespace knav
