#pragma once

#include <string>
#include <vector>

#include "depth_profile_nodelet/front_end.h"
#include "tools/profile_recording.h"

namespace knav {

/// What decides the bytes of a simulated recording.
struct SimulatedDrive {
  std::string world_file, tour_file;
  std::string sensor = "calibrated", odometry = "default";
  int seed = 1;
  double limit_s = 1e9;  ///< simulated time
  FrontEndConfig front_end;
};

/// Where benchmarks keep what they simulated: ~/.cache/kinect_nav.
std::string default_cache();

/// Recordings of simulated drives in a folder: simulating a minute of depth frames takes longer than a minute
/// of mapping by two orders, so it is done once per drive.
class SimulatedRecordings {
 public:
  /// @param folder   made if it does not exist
  /// @param fresh    simulate even what is there
  SimulatedRecordings(std::string folder, bool fresh);

  /// From the folder, or simulated now. A drive that differs in anything (world, tour, seed, presets, front
  /// end's parameters) has a file of its own.
  ProfileRecording get(const SimulatedDrive& drive);
  std::string path_of(const SimulatedDrive& drive) const;
  bool have(const SimulatedDrive& drive) const;
  /// When the button was pressed along a drive; needs no frame to be rendered.
  static std::vector<double> marks_of(const SimulatedDrive& drive);

 private:
  std::string folder_;
  bool fresh_;
};

}  // namespace knav
