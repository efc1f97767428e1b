#pragma once

#include <functional>
#include <future>

namespace knav {

/// Runs a task on a thread that does not end with it but waits for the next task, until the process ends.
///
/// OpenNI2 2.2 keeps an error text for every thread that ever called it, and asks by pthread_kill(thread, 0)
/// whether the others still live. For a thread that ended, today's glibc answers with a crash now and then
/// (seen every tenth time or so a device was closed and opened under load). So whoever calls OpenNI2 must
/// live for ever; a library with such threads must not be unloaded either (linked with -z nodelete).
std::future<void> run_on_parked_thread(std::function<void()> task);

}  // namespace knav
