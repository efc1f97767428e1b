#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/tsdf_grid.h"
#include "tsdf_local_mapper/window_config.h"

namespace knav {

/// The queue of observations that the map holds (paper section III.E): each leaves the map exactly as it
/// came.
class SlidingWindow {
 public:
  explicit SlidingWindow(const WindowConfig& config) : config_(config) {}

  /// Where to write the next observation; stays valid until push() or the next call.
  TsdfObservation& scratch();
  /// Adds the scratch observation to the grid. Its pose and sensor model must be set; sequence and clock are
  /// set here. While `parked`, only the newest few frames of the place are held.
  void push(TsdfGrid* grid, double clock_s, double travelled_m, bool parked);
  /// Takes out what is too old or too far back; a few dozen observations a call of what only doubt makes so.
  /// @param doubtful the localizer does not know where the robot is
  void expire(TsdfGrid* grid, double clock_s, double travelled_m, bool doubtful);
  /// Forgets the queue; the caller clears the grid. Sequences go on.
  void clear();

  std::uint32_t next_sequence() const { return next_sequence_; }
  int size() const { return static_cast<int>(order_.size()); }
  /// The i-th oldest.
  const TsdfObservation& at(int i) const { return slots_[order_[static_cast<std::size_t>(i)]]->observation; }
  /// How far the robot had driven then.
  double travelled_m(int i) const { return slots_[order_[static_cast<std::size_t>(i)]]->travelled_m; }
  /// Index of the oldest observation newer than `sequence`; size() if there is none.
  int first_after(std::uint32_t sequence) const;

 private:
  struct Slot {
    TsdfObservation observation;
    double clock_s = 0.0, travelled_m = 0.0;
    bool parked = false;
    bool near_only = false;  ///< its far part has left already
  };
  void remove(TsdfGrid* grid, std::size_t position);
  void expire_far_parts(TsdfGrid* grid, double travelled_m);

  WindowConfig config_;
  std::vector<std::unique_ptr<Slot>> slots_;  ///< never freed: no allocation once the window is full
  std::vector<std::size_t> order_;            ///< slots in use, oldest first
  std::vector<std::size_t> free_;
  std::size_t near_only_ = 0;  ///< so many of the oldest have been asked for their far parts
  std::uint32_t next_sequence_ = 1;
};

}  // namespace knav
