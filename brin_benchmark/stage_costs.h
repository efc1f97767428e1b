#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace knav {

/// What the robot does with a frame, in this order.
enum class Stage { kFrontEnd, kLocalMapper, kVirtualScan, kLocalizer, kLocalMap, kPlanner };
constexpr std::size_t kStages = 6;
constexpr const char* kStageName[kStages] = {"calibration, rolling shutter, floor, profile",
                                             "local mapper: align, integrate",
                                             "virtual 360-degree scan",
                                             "localizer",
                                             "local map and its overlay",
                                             "planning and tracking"};

/// Names of stages and their milliseconds a frame.
using StageTable = std::vector<std::pair<std::string, double>>;

/// Wall time by stage, added up over a run.
class StageCosts {
 public:
  /// Milliseconds a frame; empty without a frame.
  StageTable per_frame_ms(std::size_t frames) const {
    StageTable table;
    for (std::size_t i = 0; frames > 0 && i < kStages; ++i) {
      table.emplace_back(kStageName[i], 1e3 * seconds_[i] / static_cast<double>(frames));
    }
    return table;
  }

 private:
  friend class StageTimer;
  std::array<double, kStages> seconds_{};
};

/// Counts from its making, or from the last stage done, to a stage's end.
class StageTimer {
 public:
  explicit StageTimer(StageCosts* costs) : costs_(costs), since_(Clock::now()) {}
  void done(Stage stage) {
    const Clock::time_point now = Clock::now();
    costs_->seconds_[static_cast<std::size_t>(stage)] += std::chrono::duration<double>(now - since_).count();
    since_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  StageCosts* costs_;
  Clock::time_point since_;
};

}  // namespace knav
