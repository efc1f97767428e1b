#include "tsdf_localizer/localizer_diagnostics.h"

#include <algorithm>
#include <cmath>

namespace knav {

LocalizerDiagnostics::LocalizerDiagnostics(ros::NodeHandle& node, ros::NodeHandle& private_node, const std::string& name)
    : updater_(node, private_node, name) {
  updater_.setHardwareID("none");
  updater_.add("localizer", this, &LocalizerDiagnostics::report);
  // Wall time: diagnostics are wanted most when nothing drives a simulated clock.
  timer_ = node.createWallTimer(ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) { updater_.force_update(); });
}

void LocalizerDiagnostics::update(double seconds) {
  ++updates_;
  update_s_ += seconds;
  longest_s_ = std::max(longest_s_, seconds);
}

void LocalizerDiagnostics::report(diagnostic_updater::DiagnosticStatusWrapper& out) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const LocalizationVerdict verdict = result_.verdict;
  const auto level = verdict == LocalizationVerdict::kOk     ? Level::OK
                     : verdict == LocalizationVerdict::kLost ? Level::ERROR
                                                             : Level::WARN;
  out.summary(static_cast<std::uint8_t>(level), std::string(verdict_name(verdict)) + ": " + result_.reason);
  const double deg = 180.0 / kPi;
  out.add("position sd m", result_.position_sd_m);
  out.add("sd x m", std::sqrt(std::max(0.0, result_.covariance(0, 0))));
  out.add("sd y m", std::sqrt(std::max(0.0, result_.covariance(1, 1))));
  out.add("heading sd deg", result_.yaw_sd_rad * deg);
  out.add("explained share of the scan", result_.inlier_fraction);
  out.add("particles", result_.particles);
  out.add("motion epoch", result_.motion_epoch);
  out.add("corrections, small", corrections_.count[0]);
  out.add("corrections, notable", corrections_.count[1]);
  out.add("corrections, jumps", corrections_.count[2]);
  out.add("largest correction", corrections_.largest.sentence());
  out.add("scans since the last report", updates_);
  out.add("update mean ms", updates_ > 0 ? 1e3 * update_s_ / updates_ : 0.0);
  out.add("longest ms", 1e3 * longest_s_);
  corrections_ = CorrectionTally();
  updates_ = 0;
  update_s_ = longest_s_ = 0.0;
}

}  // namespace knav
