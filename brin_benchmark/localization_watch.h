#pragma once

#include <nlohmann/json.hpp>

#include "core/pose2.h"
#include "tsdf_localizer/localizer.h"

namespace knav {

/// What the localizer said at a moment, beside the truth.
struct Moment {
  double stamp_s = 0.0;
  double dt_s = 0.0;  ///< how long it held
  bool has_pose = false;
  LocalizationVerdict verdict = LocalizationVerdict::kInitializing;
  double error_m = 0.0, error_rad = 0.0;
  double support = 0.0, fresh_support = 0.0;
  Pose2 T_world_base;  ///< the truth
  bool ok() const { return verdict == LocalizationVerdict::kOk; }
};

/// Right: near enough to go on from.
constexpr double kRight_m = 0.3, kRight_deg = 5.0;
/// Wrong enough to hurt.
constexpr double kWrong_m = 0.5;

bool is_right(const Moment& moment);

/// How long a robot was how wrong. Rows of a report add up.
struct Honesty {
  double time_s = 0.0, ok_s = 0.0, uncertain_s = 0.0, lost_s = 0.0, initializing_s = 0.0;
  double ok_wrong_s = 0.0;  ///< ok while more than kWrong_m off
  void add(const Moment& moment);
  void add(const Honesty& other);
};
nlohmann::json to_json(const Honesty& honesty);

constexpr double kNoticeLimit_s = 5.0, kKidnapLimit_s = 40.0;

/// How a robot that was carried off while everything ran found out, and found itself. Times are since it was set down.
struct KidnapRecovery {
  double noticed_s = -1.0;  ///< first not ok; -1: never
  double right_s = -1.0;    ///< first ok and right; -1: not within kKidnapLimit_s
  double ok_wrong_s = 0.0;  ///< from kNoticeLimit_s to kKidnapLimit_s
  bool noticed() const { return noticed_s >= 0.0 && noticed_s <= kNoticeLimit_s; }
  bool right() const { return right_s >= 0.0; }
};

/// Fed what the localizer says from when the robot was set down elsewhere.
class KidnapWatch {
 public:
  explicit KidnapWatch(double set_down_s) : set_down_s_(set_down_s) {}
  void add(const Moment& moment);
  const KidnapRecovery& recovery() const { return recovery_; }
  /// The moment is within the time in which being ok and wrong is forgiven.
  bool forgiven(const Moment& moment) const { return moment.stamp_s - set_down_s_ <= kNoticeLimit_s; }

 private:
  double set_down_s_;
  KidnapRecovery recovery_;
};

}  // namespace knav
