#include "openni2_driver/virtual_device/control_file.h"

#include <fstream>

namespace knav {

VirtualControl read_control_file(const std::string& path) {
  VirtualControl control;
  if (path.empty()) return control;
  std::ifstream file(path);
  std::string key;
  int value = 0;
  while (file >> key >> value) {
    if (key == "plugged") control.plugged = value != 0;
    if (key == "streaming") control.streaming = value != 0;
  }
  return control;
}

}  // namespace knav
