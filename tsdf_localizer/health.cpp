#include "tsdf_localizer/health.h"

#include <algorithm>
#include <cmath>

namespace knav {

void Health::clear() {
  has_support_ = false;
  support_ = fresh_support_ = low_s_ = 0.0;
}

void Health::update(double stamp_s, const PoseCheck& check) {
  const double dt = has_support_ ? std::clamp(stamp_s - last_s_, 0.0, 1.0) : 0.0;
  last_s_ = stamp_s;
  const double keep = config_.smoothing_s > 0.0 ? std::exp(-dt / config_.smoothing_s) : 0.0;
  if (!has_support_) {
    support_ = check.support;
    fresh_support_ = check.fresh_support;
    low_s_ = 0.0;
    has_support_ = true;
    return;
  }
  support_ = keep * support_ + (1.0 - keep) * check.support;
  fresh_support_ = keep * fresh_support_ + (1.0 - keep) * check.fresh_support;
  low_s_ = std::min(support_, fresh_support_) < config_.lost_fraction ? low_s_ + dt : 0.0;
}

}  // namespace knav
