#include "core/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace knav {
namespace {
using Clock = std::chrono::steady_clock;
double seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }
}  // namespace

Progress::Progress(std::string stage)
    : stage_(std::move(stage)), terminal_(::isatty(STDERR_FILENO) != 0), start_(Clock::now()), last_(start_) {}

Progress::~Progress() {
  if (terminal_ && shown_) std::fputc('\n', stderr);
}

void Progress::update(double fraction, const std::string& note) {
  const auto now = Clock::now();
  const double interval_s = terminal_ ? 0.1 : 10.0;
  const bool finished = fraction >= 1.0;
  if (seconds(now - last_) < interval_s && !(finished && shown_)) return;
  last_ = now;
  shown_ = true;
  fraction = std::clamp(fraction, 0.0, 1.0);
  const double elapsed_s = seconds(now - start_);
  const double left_s = fraction > 0.01 ? elapsed_s * (1.0 - fraction) / fraction : 0.0;
  if (terminal_) {
    const int filled = static_cast<int>(fraction * 30.0);
    fmt::print(stderr, "\r{:<24} [{:-<30}] {:3.0f} %  {:4.0f} s left  {}\033[K", stage_,
               std::string(static_cast<std::size_t>(filled), '='), fraction * 100.0, left_s, note);
  } else {
    fmt::print(stderr, "{}: {:.0f} %, {:.0f} s left {}\n", stage_, fraction * 100.0, left_s, note);
  }
  std::fflush(stderr);
}

}  // namespace knav
