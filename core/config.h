#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "core/error.h"

namespace knav {

/// A module's configuration is a plain struct with defaults and one method that names its fields:
///
///   struct TsdfConfig {
///     double resolution_m = 0.05;
///     std::string clock = "moving";
///     template <class Visitor> void visit(Visitor& v) {
///       v.number("resolution_m", resolution_m, 0.01, 0.5, "m", "Side of a cell.");
///       v.choice("clock", clock, {"paper", "moving"}, "What the window's age counts.");
///     }
///     std::vector<std::string> validate() const;  // one sentence per fault that a range cannot express
///   };
///
/// YAML files, ROS parameters and the parameter reference in docs/ all come from visit().

/// One documented parameter, with its default as text.
struct ParameterDescription {
  std::string name;   ///< with the groups it lies in: "tsdf/resolution_m"
  std::string type;   ///< number, integer, flag, text, choice, list
  std::string default_value;
  std::string range;  ///< "0.01 ... 0.5" or "a | b"; empty if free
  std::string unit;
  std::string text;
};

/// Reads a YAML map into a config struct. Faults are collected, not thrown one by one.
class ConfigReader {
 public:
  /// @param where names the source in messages: a file and section, or a ROS namespace
  ConfigReader(const YAML::Node& node, std::string where, std::string prefix = "");

  void number(const char* name, double& value, double low, double high, const char* unit, const char* text);
  void integer(const char* name, int& value, int low, int high, const char* unit, const char* text);
  void flag(const char* name, bool& value, const char* text);
  void text(const char* name, std::string& value, const char* text);
  void choice(const char* name, std::string& value, const std::vector<std::string>& choices, const char* text);
  void list(const char* name, std::vector<double>& value, const char* unit, const char* text);
  template <class Group>
  void group(const char* name, Group& group, const char* /*text*/) {
    const YAML::Node child = take(name);
    if (child && !child.IsMap()) {
      faults_.push_back(where_ + ": '" + prefix_ + name + "' must be a group of keys.");
      return;
    }
    ConfigReader reader(child ? child : YAML::Node(YAML::NodeType::Map), where_, prefix_ + name + "/");
    group.visit(reader);
    const auto faults = reader.finish();
    faults_.insert(faults_.end(), faults.begin(), faults.end());
  }
  /// What was wrong, unknown keys (with the nearest known one) included. Call once, after visit().
  std::vector<std::string> finish();

 private:
  YAML::Node take(const char* name);
  template <class T>
  bool read(const char* name, T& value, const char* expected);

  YAML::Node node_;
  std::string where_, prefix_;
  std::vector<std::string> known_;
  std::vector<std::string> faults_;
};

/// Collects the documentation of a config struct.
class ConfigDescriber {
 public:
  void number(const char* name, double& value, double low, double high, const char* unit, const char* text);
  void integer(const char* name, int& value, int low, int high, const char* unit, const char* text);
  void flag(const char* name, bool& value, const char* text);
  void text(const char* name, std::string& value, const char* text);
  void choice(const char* name, std::string& value, const std::vector<std::string>& choices, const char* text);
  void list(const char* name, std::vector<double>& value, const char* unit, const char* text);
  template <class Group>
  void group(const char* name, Group& group, const char* /*text*/) {
    const std::string outer = prefix_;
    prefix_ += std::string(name) + "/";
    group.visit(*this);
    prefix_ = outer;
  }
  std::vector<ParameterDescription> parameters;

 private:
  std::string prefix_;
};

/// The word of `known` nearest to `word`, or "" if none is near enough to have been meant.
std::string nearest_word(const std::string& word, const std::vector<std::string>& known);

/// "a; b; c" as one UserError.
[[noreturn]] void throw_faults(const std::vector<std::string>& faults);

/// A config from a YAML map (a null node means all defaults). Throws UserError that lists every fault.
template <class Config>
Config read_config(const YAML::Node& node, const std::string& where) {
  if (node && !node.IsNull() && !node.IsMap()) throw UserError(where + ": must be a map of keys.");
  Config config;
  ConfigReader reader(node && node.IsMap() ? node : YAML::Node(YAML::NodeType::Map), where);
  config.visit(reader);
  std::vector<std::string> faults = reader.finish();
  if (faults.empty()) {
    for (const std::string& fault : config.validate()) faults.push_back(where + ": " + fault);
  }
  if (!faults.empty()) throw_faults(faults);
  return config;
}

/// A YAML file; an unreadable or malformed one is a UserError naming file and line.
YAML::Node load_yaml_file(const std::string& path);

/// The section of a configuration file (config/*.yaml) for one node, e.g. "local_mapper". An empty path gives the
/// defaults, and so does a file without that section.
template <class Config>
Config read_config_section(const std::string& path, const std::string& section) {
  if (path.empty()) return read_config<Config>(YAML::Node(), section);
  const YAML::Node file = load_yaml_file(path);
  if (!file.IsMap()) throw UserError(path + ": must be a map of sections, one per node.");
  return read_config<Config>(file[section], path + ", section '" + section + "'");
}

template <class Config>
std::vector<ParameterDescription> describe_config() {
  Config config;
  ConfigDescriber describer;
  config.visit(describer);
  return describer.parameters;
}

}  // namespace knav
