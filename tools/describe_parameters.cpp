// describe_parameters: the parameter reference and the default configuration, from the config structs.
#include <fmt/format.h>

#include "core/error.h"
#include "core/file_io.h"
#include "ros_common/command_line.h"
#include "tools/parameter_files.h"

int main(int argc, char** argv) {
  CLI::App app(
      "Writes the parameter reference (--markdown) and the default configuration (--yaml) from the config structs,\n"
      "or checks configuration files (--check).");
  std::string markdown, yaml;
  std::vector<std::string> check;
  app.add_option("--markdown", markdown, "file to write, e.g. docs/parameters.md");
  app.add_option("--yaml", yaml, "file to write, e.g. config/default.yaml");
  app.add_option("--check", check, "configuration files to check");
  return knav::run_command(app, argc, argv, [&] {
    const auto sections = knav::all_parameter_sections();
    if (!markdown.empty()) knav::write_text_atomically(markdown, knav::parameters_markdown(sections));
    if (!yaml.empty()) knav::write_text_atomically(yaml, knav::parameters_yaml(sections));
    std::vector<std::string> faults;
    for (const std::string& path : check) {
      const auto found = knav::faults_of_config_file(path);
      if (found.empty()) fmt::print("{}: good\n", path);
      faults.insert(faults.end(), found.begin(), found.end());
    }
    if (!faults.empty()) knav::throw_faults(faults);
  });
}
