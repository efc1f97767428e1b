#include <gtest/gtest.h>

#include <filesystem>

#include "core/config_sections.h"
#include "core/error.h"
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

TEST(ConfigurationSections, AreThoseOfTheStructsAndASlipIsRefusedWithASuggestion) {
  std::vector<std::string> described;
  for (const ParameterSection& section : all_parameter_sections()) described.push_back(section.name);
  EXPECT_EQ(config_section_names(), described);
  EXPECT_NO_THROW(refuse_unknown_sections(kRoot / "config" / "default.yaml"));
  const std::string path = testing::TempDir() + "/slip.yaml";
  write_text_atomically(path, "local_maper: {seed: 1}\n");
  try {
    refuse_unknown_sections(path);
    ADD_FAILURE() << "not refused";
  } catch (const UserError& error) {
    EXPECT_EQ(std::string(error.what()), path + ": unknown section 'local_maper'; did you mean 'local_mapper'?");
  }
}

}  // namespace
}  // namespace knav
