#pragma once

#include <string>

namespace knav {

/// What a test may do to the virtual devices while they run: a text file of lines "key value", named by the
/// environment variable KINECT_NAV_VIRTUAL_CONTROL and read again 50 times a second. Replace it by renaming.
struct VirtualControl {
  bool plugged = true;    ///< "plugged 0" pulls the cable of every device
  bool streaming = true;  ///< "streaming 0" leaves them connected, but no frame comes
};

/// Missing file or key: the default.
VirtualControl read_control_file(const std::string& path);

}  // namespace knav
