#include "tsdf_local_mapper/sliding_window.h"

#include <algorithm>

namespace knav {
namespace {

/// Observations a frame: a minute's leave within two seconds, and no frame takes much longer for it.
constexpr int kForgottenInDoubt = 40;

}  // namespace

TsdfObservation& SlidingWindow::scratch() {
  if (free_.empty()) {
    free_.push_back(slots_.size());
    slots_.push_back(std::make_unique<Slot>());
  }
  return slots_[free_.back()]->observation;
}

void SlidingWindow::push(TsdfGrid* grid, double clock_s, double travelled_m, bool parked) {
  if (parked) {
    std::size_t run = 0;  // parked frames at the end of the queue are those of this place
    while (run < order_.size() && slots_[order_[order_.size() - 1 - run]]->parked) ++run;
    if (run >= static_cast<std::size_t>(config_.parked_observations)) remove(grid, order_.size() - run);
  }
  if (size() >= config_.max_observations) remove(grid, 0);
  // remove() hands its slot back on top of the free list; the scratch slot is the one being written.
  scratch();
  const std::size_t index = free_.back();
  free_.pop_back();
  Slot& slot = *slots_[index];
  slot.clock_s = clock_s;
  slot.travelled_m = travelled_m;
  slot.parked = parked;
  slot.near_only = false;
  slot.observation.sequence = next_sequence_++;
  slot.observation.age_clock_s = static_cast<float>(clock_s);
  grid->add(slot.observation);
  order_.push_back(index);
}

void SlidingWindow::expire(TsdfGrid* grid, double clock_s, double travelled_m, bool doubtful) {
  int in_doubt = 0;
  while (!order_.empty()) {
    const Slot& oldest = *slots_[order_.front()];
    const double driven_m = travelled_m - oldest.travelled_m;
    const bool old = clock_s - oldest.clock_s > config_.duration_s;
    const bool far = driven_m > config_.distance_m;
    if (!old && !far) {
      if (!doubtful || driven_m <= config_.doubtful_distance_m || in_doubt >= kForgottenInDoubt) break;
      ++in_doubt;
    }
    remove(grid, 0);
  }
  expire_far_parts(grid, travelled_m);
}

void SlidingWindow::expire_far_parts(TsdfGrid* grid, double travelled_m) {
  if (config_.far_m <= 0.0) return;
  for (; near_only_ < order_.size(); ++near_only_) {
    Slot& slot = *slots_[order_[near_only_]];
    if (travelled_m - slot.travelled_m <= config_.far_distance_m) break;
    if (!slot.observation.pinhole) continue;
    grid->remove(slot.observation, {static_cast<float>(config_.far_m)});
    slot.near_only = true;
  }
}

int SlidingWindow::first_after(std::uint32_t sequence) const {
  const auto found = std::partition_point(order_.begin(), order_.end(), [&](std::size_t slot) {
    return slots_[slot]->observation.sequence <= sequence;
  });
  return static_cast<int>(found - order_.begin());
}

void SlidingWindow::clear() {
  free_.insert(free_.begin(), order_.begin(), order_.end());
  order_.clear();
  near_only_ = 0;
}

void SlidingWindow::remove(TsdfGrid* grid, std::size_t position) {
  const std::size_t index = order_[position];
  const Slot& slot = *slots_[index];
  grid->remove(slot.observation, slot.near_only ? TsdfRing{0.0f, static_cast<float>(config_.far_m)} : TsdfRing{});
  if (position < near_only_) --near_only_;
  order_.erase(order_.begin() + static_cast<std::ptrdiff_t>(position));
  free_.insert(free_.begin(), index);  // not on top: that is the scratch slot
}

}  // namespace knav
