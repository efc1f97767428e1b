#pragma once

#include <dynamic_reconfigure/Config.h>

#include <string>
#include <vector>

namespace knav {

/// Visitor that sets the fields of a config struct which a dynamic_reconfigure message names, and leaves the
/// others alone. Names and ranges of the .cfg file must be the struct's; a test compares them.
class ReconfigureReader {
 public:
  explicit ReconfigureReader(const dynamic_reconfigure::Config& message) : message_(message) {}

  void number(const char* name, double& value, double, double, const char*, const char*) {
    set(message_.doubles, name, value);
  }
  void integer(const char* name, int& value, int, int, const char*, const char*) {
    set(message_.ints, name, value);
  }
  void flag(const char* name, bool& value, const char*) { set(message_.bools, name, value); }
  void text(const char* name, std::string& value, const char*) { set(message_.strs, name, value); }
  void choice(const char* name, std::string& value, const std::vector<std::string>&, const char*) {
    set(message_.strs, name, value);
  }
  void list(const char*, std::vector<double>&, const char*, const char*) {}

 private:
  template <class Entries, class Value>
  static void set(const Entries& entries, const char* name, Value& value) {
    for (const auto& entry : entries) {
      if (entry.name == name) value = static_cast<Value>(entry.value);
    }
  }
  const dynamic_reconfigure::Config& message_;
};

/// Copies what a generated dynamic_reconfigure class holds into the config struct it belongs to.
template <class Generated, class Config>
void apply_reconfiguration(const Generated& generated, Config* config) {
  dynamic_reconfigure::Config message;
  generated.__toMessage__(message);
  ReconfigureReader reader(message);
  config->visit(reader);
}

}  // namespace knav
