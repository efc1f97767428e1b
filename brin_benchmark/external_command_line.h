#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "brin_benchmark/external_options.h"
#include "brin_benchmark/session.h"

namespace knav {

/// The options of --config external.
CLI::Option_group* add_external_options(CLI::App* app, ExternalOptions* external, SessionOptions* session);

/// UserError if options were given that go together with --config external only, or not with it.
void check_external_options(const CLI::Option_group& group, const SessionOptions& session);

/// How to go on from a folder that has the map and no runs yet.
std::string external_next_steps(const SessionOptions& session);

}  // namespace knav
