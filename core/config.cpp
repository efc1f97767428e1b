#include "core/config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0u : 1u)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::string joined(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, " | ")); }

}  // namespace

std::string nearest_word(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(3, word.size() / 2);
  for (const std::string& candidate : known) {
    const bool contains = candidate.find(word) != std::string::npos || word.find(candidate) != std::string::npos;
    const std::size_t distance = contains ? 1 : edit_distance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

void throw_faults(const std::vector<std::string>& faults) {
  throw UserError(fmt::format("{}", fmt::join(faults, "\n")));
}

YAML::Node load_yaml_file(const std::string& path) {
  try {
    return YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw UserError(path + ": cannot be opened; check the path and its permissions.");
  } catch (const YAML::Exception& error) {
    throw UserError(fmt::format("{}: line {}: {}.", path, error.mark.line + 1, error.msg));
  }
}

ConfigReader::ConfigReader(const YAML::Node& node, std::string where, std::string prefix)
    : node_(node), where_(std::move(where)), prefix_(std::move(prefix)) {}

YAML::Node ConfigReader::take(const char* name) {
  known_.emplace_back(name);
  return static_cast<const YAML::Node&>(node_)[name];
}

template <class T>
bool ConfigReader::read(const char* name, T& value, const char* expected) {
  const YAML::Node child = take(name);
  if (!child) return false;
  try {
    value = child.as<T>();
    return true;
  } catch (const YAML::Exception&) {
    faults_.push_back(fmt::format("{}: '{}{}' must be {}.", where_, prefix_, name, expected));
    return false;
  }
}

void ConfigReader::number(const char* name, double& value, double low, double high, const char* unit, const char*) {
  double given = value;
  if (!read(name, given, "a number")) return;
  if (!(given >= low && given <= high)) {
    faults_.push_back(fmt::format("{}: '{}{}' is {} but must lie in [{}, {}]{}{}.", where_, prefix_, name, given, low,
                                  high, *unit ? " " : "", unit));
    return;
  }
  value = given;
}

void ConfigReader::integer(const char* name, int& value, int low, int high, const char* unit, const char*) {
  int given = value;
  if (!read(name, given, "a whole number")) return;
  if (given < low || given > high) {
    faults_.push_back(fmt::format("{}: '{}{}' is {} but must lie in [{}, {}]{}{}.", where_, prefix_, name, given, low,
                                  high, *unit ? " " : "", unit));
    return;
  }
  value = given;
}

void ConfigReader::flag(const char* name, bool& value, const char*) { read(name, value, "true or false"); }

void ConfigReader::text(const char* name, std::string& value, const char*) { read(name, value, "a text"); }

void ConfigReader::choice(const char* name, std::string& value, const std::vector<std::string>& choices, const char*) {
  std::string given = value;
  if (!read(name, given, "a text")) return;
  if (std::find(choices.begin(), choices.end(), given) == choices.end()) {
    faults_.push_back(
        fmt::format("{}: '{}{}' is '{}' but must be one of {}.", where_, prefix_, name, given, joined(choices)));
    return;
  }
  value = given;
}

void ConfigReader::list(const char* name, std::vector<double>& value, const char*, const char*) {
  read(name, value, "a list of numbers");
}

std::vector<std::string> ConfigReader::finish() {
  for (const auto& entry : node_) {
    const auto key = entry.first.as<std::string>();
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    const std::string meant = nearest_word(key, known_);
    faults_.push_back(fmt::format("{}: unknown key '{}{}'{}.", where_, prefix_, key,
                                  meant.empty() ? "" : "; did you mean '" + prefix_ + meant + "'?"));
  }
  return std::move(faults_);
}

void ConfigDescriber::number(const char* name, double& value, double low, double high, const char* unit,
                             const char* text) {
  parameters.push_back(
      {prefix_ + name, "number", fmt::format("{}", value), fmt::format("{} ... {}", low, high), unit, text});
}

void ConfigDescriber::integer(const char* name, int& value, int low, int high, const char* unit, const char* text) {
  parameters.push_back(
      {prefix_ + name, "integer", fmt::format("{}", value), fmt::format("{} ... {}", low, high), unit, text});
}

void ConfigDescriber::flag(const char* name, bool& value, const char* text) {
  parameters.push_back({prefix_ + name, "flag", value ? "true" : "false", "", "", text});
}

void ConfigDescriber::text(const char* name, std::string& value, const char* text) {
  parameters.push_back({prefix_ + name, "text", value, "", "", text});
}

void ConfigDescriber::choice(const char* name, std::string& value, const std::vector<std::string>& choices,
                             const char* text) {
  parameters.push_back({prefix_ + name, "choice", value, joined(choices), "", text});
}

void ConfigDescriber::list(const char* name, std::vector<double>& value, const char* unit, const char* text) {
  parameters.push_back({prefix_ + name, "list", fmt::format("[{}]", fmt::join(value, ", ")), "", unit, text});
}

}  // namespace knav
