#include "tools/parameter_files.h"

#include <fmt/format.h>

#include <functional>
#include <map>

#include "brin_benchmark/navigation_stack_config.h"
#include "depth_profile_nodelet/front_end.h"
#include "global_map_builder/build_map_config.h"
#include "global_map_builder/map_server_config.h"
#include "global_map_builder/live_map_builder_config.h"
#include "global_map_builder/mapping_recorder_config.h"
#include "kinect_calib/guided_calibration_config.h"
#include "kinect_sim/simulator_node_config.h"
#include "kinect_sim/tour_driver_config.h"
#include "openni2_driver/openni2_camera_config.h"
#include "planner_tracker/planner_tracker_config.h"
#include "tsdf_local_mapper/local_mapper_config.h"
#include "tsdf_localizer/localizer_node_config.h"

namespace knav {
namespace {

struct Section {
  ParameterSection description;
  std::function<void(const YAML::Node&, const std::string&)> read;  ///< throws UserError
};

template <class Config>
Section section(const char* name, const char* purpose) {
  return {{name, purpose, describe_config<Config>()}, [](const YAML::Node& node, const std::string& where) {
            Config config;
            ConfigReader reader(node, where);
            config.visit(reader);
            // validate() is left to the node: a path it needs is given by the launch file.
            const auto faults = reader.finish();
            if (!faults.empty()) throw_faults(faults);
          }};
}

std::vector<Section> all_sections() {
  return {
      section<OpenNI2CameraConfig>("openni2_camera", "The Kinect, or any OpenNI2 device or .oni file."),
      section<DepthCorrectionConfig>("depth_correction", "Lens rectification and depth correction."),
      section<GuidedCalibrationConfig>("calibrate_depth_live", "The guided depth calibration."),
      section<RollingShutterConfig>("rolling_shutter", "Undoes the turning of the camera while a frame is read."),
      section<FloorRemovalConfig>("floor_removal", "Finds the floor, and keeps the slice of the world above it."),
      section<DepthProfileConfig>("depth_profile", "One depth per image column."),
      section<LocalMapperConfig>("local_mapper", "The sliding-window map, the motion estimate and the 360-degree scan."),
      section<LiveMapBuilderConfig>("live_map_builder", "Builds a map while the robot drives."),
      section<MappingRecorderConfig>("mapping_recorder", "Records the mapping drive."),
      section<BuildMapConfig>("map_builder", "From a recording to a map (build_map)."),
      section<MapServerConfig>("map_server", "Publishes a map directory."),
      section<LocalizerNodeConfig>("localizer", "Where the robot is in the map."),
      section<PlannerTrackerConfig>("planner_tracker", "Takes the robot to goals."),
      section<NavigationInputConfig>("navigation", "What the benchmark feeds localizer and planner with."),
      section<SimulatorNodeConfig>("simulator", "The simulated robot and building."),
      section<TourDriverConfig>("tour_driver", "Drives a script in the simulator, as a person would."),
  };
}

/// "a/b/c" -> its groups and its last part.
std::vector<std::string> parts_of(const std::string& name) {
  std::vector<std::string> parts;
  std::size_t start = 0;
  for (std::size_t slash; (slash = name.find('/', start)) != std::string::npos; start = slash + 1) {
    parts.push_back(name.substr(start, slash - start));
  }
  parts.push_back(name.substr(start));
  return parts;
}

std::string yaml_value(const ParameterDescription& p) {
  if (p.type == "text" || p.type == "choice") return "\"" + p.default_value + "\"";
  // ROS reads 20 as an integer and 20.0 as a number; a reader of either accepts both.
  return p.default_value;
}

std::string limits(const ParameterDescription& p) {
  std::string text = p.range;
  if (!p.unit.empty()) text += (text.empty() ? "" : " ") + p.unit;
  return text;
}

}  // namespace

std::vector<ParameterSection> all_parameter_sections() {
  std::vector<ParameterSection> sections;
  for (Section& s : all_sections()) sections.push_back(std::move(s.description));
  return sections;
}

std::string parameters_markdown(const std::vector<ParameterSection>& sections) {
  std::string text =
      "# Parameters\n\nWritten by `describe_parameters` from the config structs; a test compares. A configuration file "
      "has one section per node;\na name with slashes lies in groups. Unknown keys are refused.\n";
  for (const ParameterSection& s : sections) {
    text += fmt::format("\n## {}\n\n{}\n\n| parameter | default | range | meaning |\n|---|---|---|---|\n", s.name,
                        s.purpose);
    for (const ParameterDescription& p : s.parameters) {
      std::string range = limits(p);
      for (std::size_t at = 0; (at = range.find('|', at)) != std::string::npos; at += 2) range.insert(at, "\\");
      text += fmt::format("| `{}` | {} | {} | {} |\n", p.name, p.default_value.empty() ? "" : "`" + p.default_value + "`",
                          range, p.text);
    }
  }
  return text;
}

std::string parameters_yaml(const std::vector<ParameterSection>& sections) {
  std::string text =
      "# Every parameter at its default: one section per node. Written by describe_parameters.\n"
      "# A file of your own needs only what differs.\n";
  for (const ParameterSection& s : sections) {
    text += fmt::format("\n{}:  # {}\n", s.name, s.purpose);
    std::vector<std::string> open;
    for (const ParameterDescription& p : s.parameters) {
      auto parts = parts_of(p.name);
      const std::string key = parts.back();
      parts.pop_back();
      std::size_t common = 0;
      while (common < open.size() && common < parts.size() && open[common] == parts[common]) ++common;
      for (std::size_t i = common; i < parts.size(); ++i) {
        text += fmt::format("{:{}}{}:\n", "", 2 * (i + 1), parts[i]);
      }
      open = parts;
      const std::string about = limits(p);
      text += fmt::format("{:{}}{}: {}  # {}{}\n", "", 2 * (parts.size() + 1), key, yaml_value(p),
                          about.empty() ? "" : "[" + about + "] ", p.text);
    }
  }
  return text;
}

std::vector<std::string> faults_of_config_file(const std::string& path) {
  std::vector<std::string> faults;
  std::map<std::string, Section> known;
  std::vector<std::string> names;
  for (Section& s : all_sections()) {
    names.push_back(s.description.name);
    known.emplace(names.back(), std::move(s));
  }
  for (const auto& entry : load_yaml_file(path)) {
    const auto name = entry.first.as<std::string>();
    const auto found = known.find(name);
    if (found == known.end()) {
      const std::string meant = nearest_word(name, names);
      faults.push_back(path + ": unknown section '" + name + "'" +
                       (meant.empty() ? "." : "; did you mean '" + meant + "'?"));
      continue;
    }
    try {
      found->second.read(entry.second, path + ", section '" + name + "'");
    } catch (const UserError& error) {
      faults.emplace_back(error.what());
    }
  }
  return faults;
}

}  // namespace knav
