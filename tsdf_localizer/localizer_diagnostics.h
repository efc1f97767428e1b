#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <string>

#include "tsdf_localizer/correction.h"
#include "tsdf_localizer/localizer_result.h"

namespace knav {

/// What /diagnostics says of the localizer, once a second.
class LocalizerDiagnostics {
 public:
  LocalizerDiagnostics(ros::NodeHandle& node, ros::NodeHandle& private_node, const std::string& name);

  void status(const LocalizerResult& result) { result_ = result; }
  /// @param seconds that the update took
  void update(double seconds);
  void correction(const Correction& correction) { corrections_.add(correction); }

 private:
  void report(diagnostic_updater::DiagnosticStatusWrapper& out);

  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;
  LocalizerResult result_;
  CorrectionTally corrections_;
  int updates_ = 0;
  double update_s_ = 0.0, longest_s_ = 0.0;
};

}  // namespace knav
