#pragma once

#include <optional>
#include <string>

namespace knav {

/// Lines from standard input without waiting for them: meanwhile the robot is watched.
class TerminalPrompt {
 public:
  /// True if a person may sit there.
  static bool is_terminal();
  /// The next whole line, if there is one by now. UserError when the input has ended.
  std::optional<std::string> poll_line();

 private:
  std::string pending_;
};

/// A distance in metres as people write it ("0.815", "0,815 m"); nothing if it is none.
std::optional<double> parse_distance_m(const std::string& line);

}  // namespace knav
