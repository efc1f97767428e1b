#pragma once

#include <list>
#include <string>
#include <vector>

#include "openni2_driver/plugin_stream.h"

namespace knav {

/// What every device of our plugins answers for: its sensors with their modes, and its serial number.
class PluginDevice : public oni::driver::DeviceBase {
 public:
  OniStatus getSensorInfoList(OniSensorInfo** infos, int* count) override;
  OniStatus getProperty(int property, void* data, int* size) override;
  OniBool isPropertySupported(int property) override;

 protected:
  /// @param serial empty: the device tells none
  explicit PluginDevice(std::string serial) : serial_(std::move(serial)) {}
  void add_sensor(OniSensorType type, std::vector<OniVideoMode> modes);
  bool has_sensor(OniSensorType type) const;

 private:
  std::string serial_;
  std::list<std::vector<OniVideoMode>> modes_;  // where the infos point to
  std::vector<OniSensorInfo> infos_;
};

}  // namespace knav
