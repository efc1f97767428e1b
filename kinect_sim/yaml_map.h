#pragma once

#include <yaml-cpp/yaml.h>

#include <optional>
#include <string>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// Reads one YAML map of a world or script strictly: every fault is a UserError of one sentence with the
/// file, the line and the key. Call finish() when all known keys were asked for.
class YamlMap {
 public:
  /// @param path what to call this map in messages, e.g. "walls[3]"
  YamlMap(const YAML::Node& node, std::string file, std::string path);

  bool has(const char* key);
  double number(const char* key, double low, double high, std::optional<double> fallback = {});
  std::string text(const char* key, std::optional<std::string> fallback = {});
  bool flag(const char* key, bool fallback);
  /// A list of exactly `count` numbers.
  std::vector<double> numbers(const char* key, std::size_t count);
  Point2 point(const char* key);
  /// [x, y, yaw in degrees]
  Pose2 pose_deg(const char* key);
  std::vector<Point2> points(const char* key);
  template <class T>
  T choice(const char* key, const std::vector<std::pair<std::string, T>>& choices,
           std::optional<T> fallback = {}) {
    std::vector<std::string> names;
    for (const auto& entry : choices) names.push_back(entry.first);
    if (!has(key) && fallback) return *fallback;
    const std::string given = text(key);
    for (const auto& entry : choices) {
      if (entry.first == given) return entry.second;
    }
    fail_choice(key, given, names);
  }
  /// The maps of a list; none if the key is absent.
  std::vector<YamlMap> maps(const char* key);
  std::vector<YAML::Node> nodes(const char* key);
  YamlMap map(const char* key);
  /// A map that lies under `key`, for lists of mixed kinds.
  YamlMap child(const char* key, const YAML::Node& node) const;
  /// [x, y] from a node that lies under `key`.
  Point2 point_from(const char* key, const YAML::Node& node) const;
  std::vector<std::string> keys() const;

  /// Refuses keys that nobody asked for.
  void finish() const;
  /// Throws "FILE: line N: PATH: `key` MESSAGE."
  [[noreturn]] void fail(const char* key, const std::string& message) const;

 private:
  YAML::Node take(const char* key);
  [[noreturn]] void fail_choice(const char* key, const std::string& given,
                                const std::vector<std::string>& names) const;
  std::vector<double> number_list(const char* key, const YAML::Node& node) const;

  YAML::Node node_;
  std::string file_, path_;
  std::vector<std::string> known_;
};

}  // namespace knav
