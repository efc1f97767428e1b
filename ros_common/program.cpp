#include "ros_common/program.h"

#include <fmt/format.h>

#include <csignal>
#include <exception>

#include "core/error.h"
#include "core/file_io.h"

namespace knav {
namespace {

volatile std::sig_atomic_t interrupt_flag = 0;
void on_signal(int) { interrupt_flag = 1; }
struct Interrupted {};

}  // namespace

bool interrupted() { return interrupt_flag != 0; }

void stop_if_interrupted() {
  if (interrupted()) throw Interrupted{};
}

int run_program(const std::string& name, const std::function<void()>& body) {
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
#ifndef NDEBUG
  fmt::print(stderr, "{}: this is a Debug build, many times slower; use -DCMAKE_BUILD_TYPE=Release.\n", name);
#endif
  try {
    body();
    return 0;
  } catch (const Interrupted&) {
    fmt::print(stderr, "\n{}: interrupted; nothing was written.\n", name);
    return 130;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}: error: {}\n", name, error.what());
    return 1;
  }
}

void write_json(const std::string& path, const std::string& text) {
  if (path.empty()) return;
  if (path == "-") {
    fmt::print("{}\n", text);
  } else {
    write_text_atomically(path, text + "\n");
  }
}

}  // namespace knav
