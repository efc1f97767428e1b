#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace knav {

/// A connected device as the runtime lists it.
struct ConnectedDevice {
  std::string uri;
  std::string vendor;
  std::string name;
};

/// What a device_id stands for.
struct ResolvedDevice {
  std::string uri;  ///< to open; empty if there is no such device now
  bool is_file = false;
  std::string problem;  ///< one sentence that says why uri is empty and what is connected
};

/// The OpenNI2 library, initialised once for the process and shut down with the last user. Remembers which
/// devices were unplugged and which recordings ended.
class OpenNIRuntime {
 public:
  /// UserError if the library finds no driver.
  static std::shared_ptr<OpenNIRuntime> acquire();
  virtual ~OpenNIRuntime() = default;

  virtual std::vector<ConnectedDevice> devices() const = 0;
  /// Grows with every unplugging of the device.
  virtual uint64_t disconnections(const std::string& uri) const = 0;
  /// Grows with every end of the recording.
  virtual uint64_t ends_of_file(const std::string& uri) const = 0;
  /// The serial number, or "" if the device has none or cannot be opened. Opens the device for a moment.
  virtual std::string serial_number(const std::string& uri) const = 0;
};

/// Looks a device_id up: "#N", a URI, "bus@number", a file, else a serial number.
ResolvedDevice resolve_device(const OpenNIRuntime& runtime, const std::string& device_id);

}  // namespace knav
