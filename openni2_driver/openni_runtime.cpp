#include "openni2_driver/openni_runtime.h"

#include <OpenNI.h>
#include <dlfcn.h>
#include <fmt/format.h>
#include <link.h>
#include <sys/stat.h>

#include <array>
#include <charconv>
#include <map>
#include <mutex>

#include "core/error.h"

namespace knav {
namespace {

std::string extended_error() {
  std::string text = openni::OpenNI::getExtendedError();
  for (char& c : text) {
    if (c == '\n' || c == '\t' || c == '\r') c = ' ';
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

/// Tells our plugins that the runtime is about to shut down, see driver_gate.h. They are loaded by the runtime, privately, so
/// they are looked for among what this process has loaded.
void rest_drivers() {
  std::vector<std::string> paths;
  dl_iterate_phdr(
      [](dl_phdr_info* info, std::size_t, void* found) {
        const std::string path = info->dlpi_name == nullptr ? "" : info->dlpi_name;
        if (path.find("/libKinectNav") != std::string::npos) static_cast<std::vector<std::string>*>(found)->push_back(path);
        return 0;
      },
      &paths);
  for (const std::string& path : paths) {
    void* plugin = dlopen(path.c_str(), RTLD_NOW | RTLD_NOLOAD);
    if (plugin == nullptr) continue;
    if (void* rest = dlsym(plugin, "kinect_nav_driver_rest")) reinterpret_cast<void (*)()>(rest)();
    dlclose(plugin);
  }
}

class Runtime final : public OpenNIRuntime,
                      public openni::OpenNI::DeviceDisconnectedListener,
                      public openni::OpenNI::DeviceStateChangedListener {
 public:
  Runtime() {
    if (openni::OpenNI::initialize() != openni::STATUS_OK) {
      const std::string why = extended_error();
      openni::OpenNI::shutdown();
      throw UserError(
          fmt::format("OpenNI2 does not start: {}. Its drivers must lie in OpenNI2/Drivers beside "
                      "libOpenNI2.so.0, see docs/driver.md.",
                      why));
    }
    openni::OpenNI::addDeviceDisconnectedListener(this);
    openni::OpenNI::addDeviceStateChangedListener(this);
  }
  ~Runtime() override {
    rest_drivers();
    openni::OpenNI::removeDeviceStateChangedListener(this);
    openni::OpenNI::removeDeviceDisconnectedListener(this);
    openni::OpenNI::shutdown();
  }

  std::vector<ConnectedDevice> devices() const override {
    openni::Array<openni::DeviceInfo> infos;
    openni::OpenNI::enumerateDevices(&infos);
    std::vector<ConnectedDevice> list;
    for (int i = 0; i < infos.getSize(); ++i) {
      list.push_back({infos[i].getUri(), infos[i].getVendor(), infos[i].getName()});
    }
    return list;
  }

  uint64_t disconnections(const std::string& uri) const override { return count(disconnections_, uri); }
  uint64_t ends_of_file(const std::string& uri) const override { return count(ends_of_file_, uri); }

  std::string serial_number(const std::string& uri) const override {
    openni::Device device;
    if (device.open(uri.c_str()) != openni::STATUS_OK) return "";
    std::array<char, 256> text{};
    int size = static_cast<int>(text.size());
    const bool known =
        device.getProperty(ONI_DEVICE_PROPERTY_SERIAL_NUMBER, text.data(), &size) == openni::STATUS_OK;
    device.close();
    text.back() = '\0';
    return known ? text.data() : "";
  }

 private:
  void onDeviceDisconnected(const openni::DeviceInfo* info) override {
    std::lock_guard<std::mutex> lock(mutex_);
    ++disconnections_[info->getUri()];
  }
  void onDeviceStateChanged(const openni::DeviceInfo* info, openni::DeviceState state) override {
    if (state != openni::DEVICE_STATE_EOF) return;
    std::lock_guard<std::mutex> lock(mutex_);
    ++ends_of_file_[info->getUri()];
  }
  uint64_t count(const std::map<std::string, uint64_t>& counts, const std::string& uri) const {
    std::lock_guard<std::mutex> lock(mutex_);
    const auto found = counts.find(uri);
    return found == counts.end() ? 0 : found->second;
  }

  mutable std::mutex mutex_;
  std::map<std::string, uint64_t> disconnections_, ends_of_file_;
};

bool file_exists(const std::string& path) {
  struct stat info {};
  return stat(path.c_str(), &info) == 0 && S_ISREG(info.st_mode);
}

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// A simulator's Kinect is opened by its name only: it has no number, so that none takes it for the robot's.
bool has_number(const ConnectedDevice& device) {
  const std::string simulated = "kinect_nav_simulated/";
  return device.uri.compare(0, simulated.size(), simulated) != 0;
}

std::string connected_list(const std::vector<ConnectedDevice>& devices) {
  if (devices.empty()) return "no device is connected";
  std::string text = "connected:";
  int number = 0;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const ConnectedDevice& device = devices[i];
    text += fmt::format("{} {}{} {} ({})", i == 0 ? "" : ",",
                        has_number(device) ? fmt::format("#{} ", ++number) : "", device.vendor, device.name,
                        device.uri);
  }
  return text;
}

ResolvedDevice missing(const std::string& problem) {
  ResolvedDevice device;
  device.problem = problem;
  return device;
}

}  // namespace

std::shared_ptr<OpenNIRuntime> OpenNIRuntime::acquire() {
  static std::mutex mutex;
  static std::weak_ptr<OpenNIRuntime> shared;
  std::lock_guard<std::mutex> lock(mutex);
  std::shared_ptr<OpenNIRuntime> runtime = shared.lock();
  if (!runtime) {
    runtime = std::make_shared<Runtime>();
    shared = runtime;
  }
  return runtime;
}

ResolvedDevice resolve_device(const OpenNIRuntime& runtime, const std::string& device_id) {
  const std::string scheme = "file://";
  const std::string path =
      device_id.compare(0, scheme.size(), scheme) == 0 ? device_id.substr(scheme.size()) : device_id;
  if (file_exists(path)) return {path, true, ""};
  if (ends_with(path, ".oni")) {
    return missing(
        fmt::format("device_id: there is no recording '{}'; give an absolute path, since a node's working "
                    "directory is ROS_HOME.",
                    path));
  }

  const std::vector<ConnectedDevice> devices = runtime.devices();
  if (device_id.front() == '#') {
    int number = 0;
    const char* end = device_id.data() + device_id.size();
    const auto parsed = std::from_chars(device_id.data() + 1, end, number);
    if (parsed.ec != std::errc() || parsed.ptr != end || number < 1) {
      return missing(fmt::format("device_id: '{}' is no device; '#1' is the first one.", device_id));
    }
    for (const ConnectedDevice& device : devices) {
      if (has_number(device) && --number == 0) return {device.uri, false, ""};
    }
    return missing(
        fmt::format("device_id: there is no device '{}' ({}).", device_id, connected_list(devices)));
  }
  for (const ConnectedDevice& device : devices) {
    // "bus@number", openni2_camera's way, is the end of "vendor/product@bus/number".
    std::string place = device_id;
    const std::size_t at = place.find('@');
    if (at != std::string::npos) place[at] = '/';
    if (device.uri == device_id ||
        (at != std::string::npos && at > 0 && ends_with(device.uri, "@" + place))) {
      return {device.uri, false, ""};
    }
  }
  std::string serials;
  for (const ConnectedDevice& device : devices) {
    const std::string serial = runtime.serial_number(device.uri);
    if (serial == device_id) return {device.uri, false, ""};
    serials += fmt::format("{}{}", serials.empty() ? "" : ", ", serial.empty() ? "none" : serial);
  }
  return missing(fmt::format("device_id: no device has the serial number or URI '{}' ({}{}).", device_id,
                             connected_list(devices), devices.empty() ? "" : "; serial numbers: " + serials));
}

}  // namespace knav
