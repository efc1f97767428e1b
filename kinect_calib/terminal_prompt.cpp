#include "kinect_calib/terminal_prompt.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>

#include "core/error.h"

namespace knav {

bool TerminalPrompt::is_terminal() { return ::isatty(STDIN_FILENO) != 0; }

std::optional<std::string> TerminalPrompt::poll_line() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  while (pending_.find('\n') == std::string::npos && ::poll(&input, 1, 0) > 0) {
    char buffer[256];
    const ssize_t count = ::read(STDIN_FILENO, buffer, sizeof buffer);
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) return std::nullopt;
    if (count <= 0)
      throw UserError("standard input has ended: run this in a terminal, for it asks for distances.");
    pending_.append(buffer, static_cast<std::size_t>(count));
  }
  const std::size_t end = pending_.find('\n');
  if (end == std::string::npos) return std::nullopt;
  std::string line = pending_.substr(0, end);
  pending_.erase(0, end + 1);
  return line;
}

std::optional<double> parse_distance_m(const std::string& line) {
  std::string text = line;
  std::replace(text.begin(), text.end(), ',', '.');
  char* end = nullptr;
  const double value_m = std::strtod(text.c_str(), &end);
  if (end == text.c_str()) return std::nullopt;
  std::string unit(end);
  unit.erase(
      std::remove_if(unit.begin(), unit.end(), [](char c) { return c == ' ' || c == '\r' || c == '\t'; }),
      unit.end());
  if (!unit.empty() && unit != "m") return std::nullopt;
  if (!(value_m > 0.0 && value_m < 100.0)) return std::nullopt;
  return value_m;
}

}  // namespace knav
