#include "brin_benchmark/localization_watch.h"

namespace knav {

bool is_right(const Moment& m) { return m.has_pose && m.error_m <= kRight_m && m.error_rad <= kRight_deg * kPi / 180.0; }

void Honesty::add(const Moment& m) {
  time_s += m.dt_s;
  switch (m.verdict) {
    case LocalizationVerdict::kOk:
      ok_s += m.dt_s;
      if (!(m.error_m <= kWrong_m)) ok_wrong_s += m.dt_s;
      break;
    case LocalizationVerdict::kUncertain:
      uncertain_s += m.dt_s;
      break;
    case LocalizationVerdict::kLost:
      lost_s += m.dt_s;
      break;
    case LocalizationVerdict::kInitializing:
      initializing_s += m.dt_s;
      break;
  }
}

void Honesty::add(const Honesty& o) {
  time_s += o.time_s;
  ok_s += o.ok_s;
  uncertain_s += o.uncertain_s;
  lost_s += o.lost_s;
  initializing_s += o.initializing_s;
  ok_wrong_s += o.ok_wrong_s;
}

nlohmann::json to_json(const Honesty& h) {
  return {{"time_s", h.time_s}, {"ok_s", h.ok_s}, {"uncertain_s", h.uncertain_s}, {"lost_s", h.lost_s},
          {"initializing_s", h.initializing_s}, {"ok_wrong_s", h.ok_wrong_s},
          {"ok_percent", h.time_s > 0.0 ? 100.0 * h.ok_s / h.time_s : 0.0}};
}

void KidnapWatch::add(const Moment& m) {
  const double since_s = m.stamp_s - set_down_s_;
  if (since_s > kKidnapLimit_s) return;
  if (!forgiven(m) && m.ok() && m.error_m > kWrong_m) recovery_.ok_wrong_s += m.dt_s;
  if (recovery_.noticed_s < 0.0 && !m.ok()) recovery_.noticed_s = since_s;
  if (recovery_.right_s < 0.0 && m.ok() && is_right(m)) recovery_.right_s = since_s;
}

}  // namespace knav
