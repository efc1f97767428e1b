#include <gtest/gtest.h>

#include <filesystem>

#include "core/file_io.h"
#include "tools/parameter_files.h"

namespace knav {
namespace {

const std::filesystem::path kRoot = KINECT_NAV_SOURCE_DIR;

TEST(ShippedConfigurations, AllLoad) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kRoot / "config")) {
    if (entry.path().extension() != ".yaml") continue;
    ++count;
    for (const std::string& fault : faults_of_config_file(entry.path())) ADD_FAILURE() << fault;
  }
  EXPECT_GE(count, 1);
}

TEST(ShippedConfigurations, DefaultIsWhatTheStructsSay) {
  EXPECT_EQ(read_text_file(kRoot / "config" / "default.yaml"), parameters_yaml(all_parameter_sections()))
      << "run describe_parameters --yaml config/default.yaml";
}

TEST(ParameterReference, IsWhatTheStructsSay) {
  EXPECT_EQ(read_text_file(kRoot / "docs" / "parameters.md"), parameters_markdown(all_parameter_sections()))
      << "run describe_parameters --markdown docs/parameters.md";
}

TEST(ParameterReference, EveryParameterHasAMeaning) {
  for (const ParameterSection& section : all_parameter_sections()) {
    for (const ParameterDescription& p : section.parameters) EXPECT_FALSE(p.text.empty()) << section.name << "/" << p.name;
  }
}

}  // namespace
}  // namespace knav
