#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>
#include <set>
#include <vector>

#include "core/camera_model.h"

namespace knav {

/// What tells one depth sensor's frames from another's, gathered from any frames with flat pieces in them:
/// the same measure for real and for simulated ones. Works on disparity codes of 1/8 px (1 / depth over
/// kInverseDepthPerCode).
class SensorStatistics {
 public:
  static constexpr int kDepthBins = 3, kIncidenceBins = 4;
  static constexpr std::array<double, kDepthBins + 1> kDepth_m = {0.5, 1.2, 2.0, 4.0};
  static constexpr std::array<double, kIncidenceBins + 1> kIncidence_deg = {0, 30, 50, 65, 80};
  static constexpr std::array<int, 3> kLags_px = {1, 4, 8};

  /// @param patch_px side of the patches that a quadratic surface is fitted to
  /// @param walls    the frames show one flat wall each: look for vertical bands too. Else only patches in
  /// the
  ///                 middle of a plane twice their size tell of the noise: cloth, edges and clutter have a
  ///                 relief
  SensorStatistics(int patch_px, bool walls) : patch_px_(patch_px), walls_(walls) {}
  /// @param depth_m 32FC1 m, NaN invalid
  void add(const cv::Mat& depth_m, const PinholeModel& camera);

  int frames() const { return frames_; }
  /// What a frame shows flat: a window in which codes = plane . ((u - cx) / fx, (v - cy) / fy, 1).
  struct FlatPiece {
    cv::Rect window;
    Eigen::Vector3d plane;
  };
  /// The surroundings of the newest frame's patches.
  const std::vector<FlatPiece>& flat_pieces() const { return flat_pieces_; }
  /// Of flat patches: medians of the residuals' sd and of their autocorrelation at kLags_px.
  struct Noise {
    int patches = 0;
    double sd_codes = 0.0;
    std::array<double, 3> along_rows{}, down_columns{};
  };
  /// Of the patches that the rays meet at these angles off square; NaN if there are none.
  Noise noise(double from_deg = 0.0, double to_deg = 90.0) const;
  double band_step_codes() const;  ///< rms of the steps between vertical bands; NaN without walls
  double bands_per_frame() const;
  /// Different readings per code between the 1st and the 99th percentile of all readings.
  double levels_per_code() const;
  struct Valid {
    double tiles = 0.0, fraction = 0.0;
  };
  /// Share of the pixels of flat 16 x 16 tiles that answer, by the tile's depth and the rays' incidence.
  Valid valid(int depth_bin, int incidence_bin) const;

 private:
  void add_patches(const cv::Mat& codes, const PinholeModel& camera);
  void add_tiles(const cv::Mat& codes, const PinholeModel& camera);
  void add_bands(const cv::Mat& depth_m);
  void add_levels(const cv::Mat& codes);

  int patch_px_;
  bool walls_;
  int frames_ = 0;
  struct Patch {
    double incidence_deg, sd_codes;
    std::array<double, 3> along_rows, down_columns;
  };
  std::vector<Patch> patches_;
  std::vector<FlatPiece> flat_pieces_;
  std::vector<double> band_steps_, levels_per_code_;
  double valid_sum_[kDepthBins][kIncidenceBins] = {}, valid_tiles_[kDepthBins][kIncidenceBins] = {};
};

/// Residuals of a wall about one quadratic surface, 8-bit grey: +-3 codes.
cv::Mat residual_picture(const cv::Mat& depth_m);

}  // namespace knav
