#pragma once

#include "tsdf_localizer/localizer_config.h"
#include "tsdf_localizer/pose_check.h"

namespace knav {

/// Follows over time how well the map explains what is seen from the estimated pose.
class Health {
 public:
  explicit Health(const HealthConfig& config) : config_(config) {}

  void clear();
  /// The pose was changed on purpose: judge anew, from the next scan.
  void judge_anew() { has_support_ = false; }
  void update(double stamp_s, const PoseCheck& check);
  /// A scan that says nothing.
  void pass(double stamp_s) { last_s_ = stamp_s; }

  double support() const { return support_; }
  double fresh_support() const { return fresh_support_; }
  bool good() const {
    return has_support_ && support_ >= config_.ok_fraction && fresh_support_ >= config_.fresh_ok_fraction;
  }
  /// Very bad for long enough.
  bool lost() const { return has_support_ && low_s_ >= config_.lost_after_s; }

 private:
  HealthConfig config_;
  bool has_support_ = false;
  double support_ = 0.0, fresh_support_ = 0.0;
  double last_s_ = 0.0;
  double low_s_ = 0.0;  ///< how long the support has been below lost_fraction
};

}  // namespace knav
