#pragma once

#include <chrono>
#include <string>

namespace knav {

/// A progress line on standard error: a bar on a terminal, a line every ten seconds otherwise.
class Progress {
 public:
  explicit Progress(std::string stage);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// @param fraction done, in [0, 1]
  /// @param note     e.g. "1200 frames"
  void update(double fraction, const std::string& note = "");

 private:
  std::string stage_;
  bool terminal_;
  bool shown_ = false;
  std::chrono::steady_clock::time_point start_, last_;
};

}  // namespace knav
