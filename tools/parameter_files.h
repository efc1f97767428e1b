#pragma once

#include <string>
#include <vector>

#include "core/config.h"

namespace knav {

/// The parameters of one node, as they stand in a configuration file's section.
struct ParameterSection {
  std::string name;     ///< of the node and of the section
  std::string purpose;  ///< a sentence
  std::vector<ParameterDescription> parameters;
};

/// Every node's section, in the order of the graph.
std::vector<ParameterSection> all_parameter_sections();

/// docs/parameters.md.
std::string parameters_markdown(const std::vector<ParameterSection>& sections);
/// config/default.yaml: every parameter at its default, with its range, unit and meaning.
std::string parameters_yaml(const std::vector<ParameterSection>& sections);

/// The sections of a configuration file that do not read as their node's parameters, in words; unknown sections too.
std::vector<std::string> faults_of_config_file(const std::string& path);

}  // namespace knav
