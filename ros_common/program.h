#pragma once

#include <functional>
#include <string>

namespace knav {

/// The frame of every command line program: runs `body`, prints a UserError (or any other) as one line
/// `NAME: error: ...` on standard error. Exit code 0, or 1 after an error; 130 after Ctrl-C.
int run_program(const std::string& name, const std::function<void()>& body);

/// True once Ctrl-C or SIGTERM came; long loops ask and call stop_if_interrupted().
bool interrupted();
/// Throws what run_program turns into exit code 130, after destructors removed half-written files.
void stop_if_interrupted();

/// Writes JSON text to a file atomically, or to standard output for "-"; does nothing for an empty path.
void write_json(const std::string& path, const std::string& text);

}  // namespace knav
