#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "core/contour.h"
#include "core/depth_profile.h"
#include "core/pose2.h"
#include "core/tsdf_grid.h"
#include "tsdf_local_mapper/sliding_window.h"

namespace knav {

/// What may be steadily wrong with a depth camera's columns.
struct RangeErrorsConfig {
  bool learn = true;
  int bands = 40;
  double offset_sd_per_m = 0.0006;
  double memory_m = 3000.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.flag("learn", learn,
           "DepthProfile: learn what is steadily wrong with the columns' depth, from surfaces that were seen from afar and "
           "later from nearer, and take it out. Never in build_map.");
    v.integer("bands", bands, 2, 320, "", "Places across the image at which it is estimated; linear in between.");
    v.number("offset_sd_per_m", offset_sd_per_m, 1e-6, 0.02, "1/m",
             "How wrong the inverse depth may be (sd): 0.0006 is 0.6 % at 10 m.");
    v.number("memory_m", memory_m, 10, 1000000, "m", "Distance over which the errors may change.");
  }
};

/// What was learned, to be kept from one drive to the next: per band of columns the offset of the inverse depth, and its
/// standard deviation.
struct RangeOffsets {
  std::vector<double> offset_per_m, sd_per_m;

  /// UserError if the file is none of ours.
  static RangeOffsets load(const std::string& path);
  /// Atomic.
  void save(const std::string& path) const;
};

/// The steady errors of a depth camera by column, learned while driving (no counterpart in the paper). A depth camera
/// measures disparity; what a calibration leaves is nearly constant in it, so it shifts the inverse depth and grows with the
/// depth squared: half a centimetre at 3 m is 8 cm at 12 m. A surface that the robot saw from afar and then from nearer shows
/// the difference. One linear-Gaussian estimate over all bands; the error of each frame's pose is estimated along with it
/// and marginalised. What all columns have in common stays as the calibration left it: over a drive it can hardly be told
/// from a wrong scale of odometry.
class RangeErrors {
 public:
  RangeErrors(const RangeErrorsConfig& config, const TsdfConfig& tsdf);

  bool on() const { return config_.learn; }
  /// Begins with what an earlier drive learned, taken at its standard deviations. UserError if they do not belong together.
  void start_from(const RangeOffsets& offsets);
  /// Another map: its poses have nothing to do with those before. What was learned stays: it is the same camera.
  void new_map();

  /// Takes the errors out of the profile that becomes observation `sequence`.
  void correct(std::uint32_t sequence, DepthProfile* profile);
  /// Learns from each observation that the robot has left kSeenAgain_m behind.
  void learn(const SlidingWindow& window, double travelled_m, const TsdfGrid& grid, const ContourConfig& contour);

  RangeOffsets offsets() const;

 private:
  struct Place {
    int band;
    double share;  ///< of the next band
  };
  struct Version {
    std::uint32_t first_sequence;
    Eigen::VectorXd offset;
  };
  struct Reading;

  Place place_of(std::size_t column, std::size_t columns) const;
  double offset_at(const Eigen::VectorXd& offset, std::size_t column, std::size_t columns) const;
  const Eigen::VectorXd& offset_then(std::uint32_t sequence);
  bool due(const Pose2& T_map_sensor) const;
  bool compare(const TsdfObservation& observation, std::size_t column, const Eigen::VectorXd& then, const TsdfGrid& grid,
               const ContourConfig& contour, Reading* reading) const;
  double squared_range_of_looks(double x_m, double y_m) const;
  void forget_some(double moved_m);
  void learn_from(const TsdfObservation& observation, const TsdfGrid& grid, const ContourConfig& contour);

  RangeErrorsConfig config_;
  TsdfConfig tsdf_;
  Eigen::MatrixXd prior_, information_;
  Eigen::VectorXd evidence_, offset_;
  std::deque<Version> versions_;  ///< by which offsets the held observations were corrected
  bool changed_ = true;           ///< since the newest version
  std::uint32_t learned_ = 0;     ///< the newest observation looked at
  Pose2 T_map_sensor_;            ///< of the last one learned from
  bool any_ = false;
  // Scratch: no allocation while driving.
  std::vector<Pose2> looks_;  ///< poses of the observations in the map
  Eigen::MatrixXd frame_information_, common_, common_gain_;
  Eigen::VectorXd frame_evidence_;
  Eigen::LLT<Eigen::MatrixXd> solver_;
};

}  // namespace knav
