// cfg/OpenNI2Camera.cfg and the config struct say the same, and a reconfiguration reaches the struct.
#include <gtest/gtest.h>
#include <kinect_nav/OpenNI2CameraConfig.h>

#include <set>

#include "openni2_driver/openni2_camera_config.h"
#include "ros_common/reconfigure.h"

namespace {

using Generated = kinect_nav::OpenNI2CameraConfig;

/// Compares every field of the struct that the .cfg has with the .cfg's.
class Comparison {
 public:
  Comparison() {
    Generated::__getDefault__().__toMessage__(default_);
    Generated::__getMin__().__toMessage__(min_);
    Generated::__getMax__().__toMessage__(max_);
  }
  void number(const char* name, double& value, double low, double high, const char* unit, const char* text) {
    ranged(default_.doubles, min_.doubles, max_.doubles, name, value, low, high, unit, text);
  }
  void integer(const char* name, int& value, int low, int high, const char* unit, const char* text) {
    ranged(default_.ints, min_.ints, max_.ints, name, value, low, high, unit, text);
  }
  void flag(const char* name, bool& value, const char* text) {
    for (const auto& entry : default_.bools) {
      if (entry.name != name) continue;
      EXPECT_EQ(entry.value != 0, value) << name;
      describe(name, "", text);
    }
  }
  void text(const char*, std::string&, const char*) {}
  std::set<std::string> compared;

 private:
  template <class Entries, class Value>
  void ranged(const Entries& defaults, const Entries& lows, const Entries& highs, const char* name,
              Value value, Value low, Value high, const char* unit, const char* text) {
    for (std::size_t i = 0; i < defaults.size(); ++i) {
      if (defaults[i].name != name) continue;
      EXPECT_EQ(defaults[i].value, value) << name;
      EXPECT_EQ(lows[i].value, low) << name;
      EXPECT_EQ(highs[i].value, high) << name;
      describe(name, unit, text);
    }
  }
  void describe(const std::string& name, const std::string& unit, const std::string& text) {
    compared.insert(name);
    for (const auto& group : Generated::__getDescriptionMessage__().groups) {
      for (const auto& parameter : group.parameters) {
        if (parameter.name == name) {
          EXPECT_EQ(parameter.description, unit.empty() ? text : text + " [" + unit + "]") << name;
        }
      }
    }
  }
  dynamic_reconfigure::Config default_, min_, max_;
};

}  // namespace

TEST(Reconfigure, TheCfgFileHasTheStructsNamesDefaultsRangesAndTexts) {
  knav::OpenNI2CameraConfig config;
  Comparison comparison;
  config.visit(comparison);
  std::set<std::string> names;
  for (const auto& parameter : Generated::__getParamDescriptions__()) names.insert(parameter->name);
  EXPECT_EQ(comparison.compared, names) << "a parameter of the .cfg file is not in the struct";
  EXPECT_GE(names.size(), 12U);
}

TEST(Reconfigure, ChangesReachTheStructAndTheRestStays) {
  knav::OpenNI2CameraConfig config;
  config.depth_frame_id = "mine";
  Generated wanted = Generated::__getDefault__();
  wanted.rate_hz = 60;
  wanted.enable_reconnect = false;
  wanted.depth_time_offset = -0.5;
  knav::apply_reconfiguration(wanted, &config);
  EXPECT_EQ(config.device.rate_hz, 60);
  EXPECT_FALSE(config.device.enable_reconnect);
  EXPECT_EQ(config.depth_time_offset, -0.5);
  EXPECT_EQ(config.ir_time_offset, -0.033);
  EXPECT_EQ(config.depth_frame_id, "mine");
}
