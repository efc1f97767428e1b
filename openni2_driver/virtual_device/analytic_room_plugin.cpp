#include "openni2_driver/virtual_device/analytic_room.h"

namespace knav {
std::unique_ptr<FrameSource> make_frame_source(int /*device*/) { return std::make_unique<AnalyticRoom>(); }
}  // namespace knav
