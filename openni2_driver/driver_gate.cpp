#include "openni2_driver/driver_gate.h"

#include <mutex>

namespace knav {
namespace {

/// One a plugin. Recursive: the runtime may open a device from within the call, and that may tell more.
std::recursive_mutex gate;
bool closed = false;

}  // namespace

void DriverGate::open() {
  std::lock_guard<std::recursive_mutex> lock(gate);
  closed = false;
}

void DriverGate::tell(const std::function<void()>& call) {
  std::lock_guard<std::recursive_mutex> lock(gate);
  if (!closed) call();
}

}  // namespace knav

void kinect_nav_driver_rest() {
  std::lock_guard<std::recursive_mutex> lock(knav::gate);
  knav::closed = true;
}
