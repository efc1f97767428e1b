#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/config.h"

namespace knav {
namespace {

using testing::HasSubstr;

struct Inner {
  int count = 3;
  template <class Visitor>
  void visit(Visitor& v) {
    v.integer("count", count, 1, 10, "", "How many.");
  }
};

struct Outer {
  double range_max_m = 20.0;
  std::string clock = "moving";
  Inner inner;
  template <class Visitor>
  void visit(Visitor& v) {
    v.number("range_max_m", range_max_m, 0.5, 26, "m", "Farthest reading used.");
    v.choice("clock", clock, {"paper", "moving"}, "What ages.");
    v.group("inner", inner, "The inner part.");
  }
  std::vector<std::string> validate() const {
    if (inner.count == 7) return {"'inner/count' must not be 7."};
    return {};
  }
};

std::string fault_of(const std::string& yaml) {
  try {
    read_config<Outer>(YAML::Load(yaml), "here");
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

TEST(Config, ReadsGroupsAndKeepsDefaults) {
  const auto config = read_config<Outer>(YAML::Load("{range_max_m: 8, inner: {count: 5}}"), "here");
  EXPECT_EQ(config.range_max_m, 8.0);
  EXPECT_EQ(config.inner.count, 5);
  EXPECT_EQ(config.clock, "moving");
}

TEST(Config, UnknownKeyIsRefusedWithSuggestion) {
  EXPECT_THAT(fault_of("{max_range_m: 8}"), HasSubstr("unknown key 'max_range_m'"));
  EXPECT_THAT(fault_of("{range_max: 8}"), HasSubstr("did you mean 'range_max_m'"));
  EXPECT_THAT(fault_of("{inner: {cuont: 8}}"), HasSubstr("did you mean 'inner/count'"));
}

TEST(Config, FaultsNameKeyAndLimits) {
  EXPECT_THAT(fault_of("{range_max_m: 30}"), HasSubstr("'range_max_m' is 30 but must lie in [0.5, 26] m"));
  EXPECT_THAT(fault_of("{range_max_m: .nan}"), HasSubstr("range_max_m"));
  EXPECT_THAT(fault_of("{range_max_m: far}"), HasSubstr("must be a number"));
  EXPECT_THAT(fault_of("{clock: papr}"), HasSubstr("one of paper | moving"));
  EXPECT_THAT(fault_of("{inner: 3}"), HasSubstr("group"));
  EXPECT_THAT(fault_of("{inner: {count: 7}}"), HasSubstr("must not be 7"));
}

TEST(Config, DescribesEveryParameter) {
  const auto parameters = describe_config<Outer>();
  ASSERT_EQ(parameters.size(), 3u);
  EXPECT_EQ(parameters[2].name, "inner/count");
  EXPECT_EQ(parameters[0].default_value, "20");
  EXPECT_EQ(parameters[1].range, "paper | moving");
}

}  // namespace
}  // namespace knav
