#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "ros_common/program.h"

namespace knav {

/// Parses, then runs `body` as run_program() does. A fault in the command line is exit code 1 as any other.
inline int run_command(CLI::App& app, int argc, char** argv, const std::function<void()>& body) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 1;
  }
  const std::string path = argv[0];
  return run_program(path.substr(path.rfind('/') + 1), body);
}

}  // namespace knav
