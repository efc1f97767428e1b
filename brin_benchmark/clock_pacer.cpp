#include "brin_benchmark/clock_pacer.h"

#include <algorithm>
#include <thread>

namespace knav {
namespace {

/// Time lost by a stall longer than this stays lost: nobody's clock shall run fast to catch up.
constexpr std::chrono::milliseconds kLongestDebt{200};

}  // namespace

ClockPacer::ClockPacer(const PacingConfig& config) : config_(config) {}

void ClockPacer::heard(Answer answer, double stamp_s) {
  const std::lock_guard<std::mutex> lock(mutex_);
  newest_s_[answer] = std::max(newest_s_[answer], stamp_s);
  silent_[answer] = false;
  heard_.notify_all();
}

void ClockPacer::wait(double now_s, bool expects_command) {
  bool answers = true;
  if (config_.waits()) {
    // A goal that was only just sent cannot have been answered.
    if (expects_command && !expected_command_) heard(kCommand, now_s);
    answers = follow(kPose, now_s);
    if (expects_command) answers = follow(kCommand, now_s) && answers;
  }
  expected_command_ = expects_command;
  const double rate = config_.rate > 0.0 ? config_.rate : answers ? 0.0 : 1.0;
  if (rate > 0.0) {
    follow_wall(now_s, rate);
  } else {
    started_ = false;
  }
  last_s_ = now_s;
}

void ClockPacer::follow_wall(double now_s, double rate) {
  const Wall::time_point now = Wall::now();
  const std::chrono::duration<double> took(started_ ? std::max(0.0, now_s - last_s_) / rate : 0.0);
  if (!started_) due_ = now;
  started_ = true;
  due_ += std::chrono::duration_cast<Wall::duration>(took);
  if (now - due_ > kLongestDebt) due_ = now;
  std::this_thread::sleep_until(due_);
}

bool ClockPacer::follow(Answer answer, double now_s) {
  std::unique_lock<std::mutex> lock(mutex_);
  const auto follows = [&] { return newest_s_[answer] >= now_s - config_.lead_s - 1e-9; };
  if (follows()) return true;
  if (silent_[answer]) return false;
  silent_[answer] = !heard_.wait_for(lock, std::chrono::duration<double>(config_.patience_s), follows);
  return !silent_[answer];
}

}  // namespace knav
