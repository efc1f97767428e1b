#include "kinect_sim/yaml_map.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "core/config.h"
#include "core/error.h"

namespace knav {

YamlMap::YamlMap(const YAML::Node& node, std::string file, std::string path)
    : node_(node), file_(std::move(file)), path_(std::move(path)) {
  if (!node_.IsMap()) {
    throw UserError(fmt::format("{}: line {}: {} must be a map of keys.", file_, node_.Mark().line + 1,
                                path_.empty() ? "the file" : "'" + path_ + "'"));
  }
  std::vector<std::string> seen;
  for (const std::string& key : keys()) {
    if (std::find(seen.begin(), seen.end(), key) != seen.end()) fail(key.c_str(), "is given twice");
    seen.push_back(key);
  }
}

void YamlMap::fail(const char* key, const std::string& message) const {
  const YAML::Node child = *key ? static_cast<const YAML::Node&>(node_)[key] : YAML::Node();
  const int line = (child && child.Mark().line >= 0 ? child.Mark().line : node_.Mark().line) + 1;
  const std::string name = path_.empty() ? key : *key ? path_ + "/" + key : path_;
  throw UserError(fmt::format("{}: line {}: '{}' {}.", file_, line, name, message));
}

void YamlMap::fail_choice(const char* key, const std::string& given,
                          const std::vector<std::string>& names) const {
  const std::string meant = nearest_word(given, names);
  fail(key, fmt::format("is '{}' but must be one of {}{}", given, fmt::join(names, " | "),
                        meant.empty() ? "" : " (did you mean '" + meant + "'?)"));
}

YAML::Node YamlMap::take(const char* key) {
  known_.emplace_back(key);
  return static_cast<const YAML::Node&>(node_)[key];
}

bool YamlMap::has(const char* key) {
  const YAML::Node child = take(key);
  return child && !child.IsNull();
}

double YamlMap::number(const char* key, double low, double high, std::optional<double> fallback) {
  const YAML::Node child = take(key);
  if (!child) {
    if (fallback) return *fallback;
    fail(key, "is missing");
  }
  double value = 0.0;
  try {
    value = child.as<double>();
  } catch (const YAML::Exception&) {
    fail(key, "must be a number");
  }
  if (!(value >= low && value <= high))
    fail(key, fmt::format("is {} but must lie in [{}, {}]", value, low, high));
  return value;
}

std::string YamlMap::text(const char* key, std::optional<std::string> fallback) {
  const YAML::Node child = take(key);
  if (!child) {
    if (fallback) return *fallback;
    fail(key, "is missing");
  }
  if (!child.IsScalar()) fail(key, "must be a text");
  return child.as<std::string>();
}

bool YamlMap::flag(const char* key, bool fallback) {
  const YAML::Node child = take(key);
  if (!child) return fallback;
  try {
    return child.as<bool>();
  } catch (const YAML::Exception&) {
    fail(key, "must be true or false");
  }
}

std::vector<double> YamlMap::number_list(const char* key, const YAML::Node& node) const {
  try {
    const auto values = node.as<std::vector<double>>();
    for (const double value : values) {
      if (!std::isfinite(value) || std::abs(value) > 1e5)
        fail(key, "holds a number that is not finite or beyond 1e5");
    }
    return values;
  } catch (const YAML::Exception&) {
    fail(key, "must be a list of numbers");
  }
}

std::vector<double> YamlMap::numbers(const char* key, std::size_t count) {
  const YAML::Node child = take(key);
  if (!child) fail(key, "is missing");
  std::vector<double> values = number_list(key, child);
  if (values.size() != count) fail(key, fmt::format("must have {} numbers, not {}", count, values.size()));
  return values;
}

Point2 YamlMap::point(const char* key) {
  const std::vector<double> xy = numbers(key, 2);
  return {xy[0], xy[1]};
}

Pose2 YamlMap::pose_deg(const char* key) {
  const std::vector<double> xyt = numbers(key, 3);
  return {xyt[0], xyt[1], normalize_angle_rad(xyt[2] * kPi / 180.0)};
}

std::vector<Point2> YamlMap::points(const char* key) {
  std::vector<Point2> result;
  for (const YAML::Node& child : nodes(key)) {
    result.push_back(point_from(key, child));
  }
  return result;
}

std::vector<YAML::Node> YamlMap::nodes(const char* key) {
  const YAML::Node child = take(key);
  if (!child || child.IsNull()) return {};
  if (!child.IsSequence()) fail(key, "must be a list");
  return {child.begin(), child.end()};
}

std::vector<YamlMap> YamlMap::maps(const char* key) {
  std::vector<YamlMap> result;
  const std::string prefix = path_.empty() ? key : path_ + "/" + key;
  const std::vector<YAML::Node> children = nodes(key);
  for (std::size_t i = 0; i < children.size(); ++i) {
    result.emplace_back(children[i], file_, fmt::format("{}[{}]", prefix, i));
  }
  return result;
}

YamlMap YamlMap::map(const char* key) {
  const YAML::Node child = take(key);
  if (!child) fail(key, "is missing");
  return {child, file_, path_.empty() ? key : path_ + "/" + key};
}

YamlMap YamlMap::child(const char* key, const YAML::Node& node) const {
  return {node, file_, path_.empty() ? key : path_ + "/" + key};
}

Point2 YamlMap::point_from(const char* key, const YAML::Node& node) const {
  const std::vector<double> xy = number_list(key, node);
  if (xy.size() != 2) fail(key, "must be made of [x, y] points");
  return {xy[0], xy[1]};
}

std::vector<std::string> YamlMap::keys() const {
  std::vector<std::string> result;
  for (const auto& entry : node_) result.push_back(entry.first.as<std::string>());
  return result;
}

void YamlMap::finish() const {
  for (const std::string& key : keys()) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    const std::string meant = nearest_word(key, known_);
    fail(key.c_str(),
         "is not a key known here" + (meant.empty() ? std::string() : "; did you mean '" + meant + "'?"));
  }
}

}  // namespace knav
