#pragma once

#include <functional>

namespace knav {

/// Through which a plugin's own threads tell the runtime that a device came or went. The runtime's shutdown holds the very
/// lock that those calls take, while it waits for the plugin to end its threads: a device that comes or goes just then is a
/// deadlock. So whoever shuts the runtime down closes the gates of all plugins first (rest_drivers()).
class DriverGate {
 public:
  /// Lets news pass again: when the driver is initialized.
  static void open();
  /// Runs the call, unless the gate is closed.
  static void tell(const std::function<void()>& call);
};

}  // namespace knav

/// Closes this plugin's gate. Returns when no call is under way.
extern "C" __attribute__((visibility("default"))) void kinect_nav_driver_rest();
