#include "openni2_driver/plugin_device.h"

#include <cstring>

namespace knav {

void PluginDevice::add_sensor(OniSensorType type, std::vector<OniVideoMode> modes) {
  modes_.push_back(std::move(modes));
  infos_.push_back({type, static_cast<int>(modes_.back().size()), modes_.back().data()});
}

bool PluginDevice::has_sensor(OniSensorType type) const {
  for (const OniSensorInfo& info : infos_) {
    if (info.sensorType == type) return true;
  }
  return false;
}

OniStatus PluginDevice::getSensorInfoList(OniSensorInfo** infos, int* count) {
  *infos = infos_.data();
  *count = static_cast<int>(infos_.size());
  return ONI_STATUS_OK;
}

OniStatus PluginDevice::getProperty(int property, void* data, int* size) {
  if (!isPropertySupported(property)) return ONI_STATUS_NOT_IMPLEMENTED;
  const int needed = static_cast<int>(serial_.size()) + 1;
  if (*size < needed) return ONI_STATUS_BAD_PARAMETER;
  std::memcpy(data, serial_.c_str(), static_cast<std::size_t>(needed));
  *size = needed;
  return ONI_STATUS_OK;
}

OniBool PluginDevice::isPropertySupported(int property) {
  return property == ONI_DEVICE_PROPERTY_SERIAL_NUMBER && !serial_.empty() ? TRUE : FALSE;
}

}  // namespace knav
