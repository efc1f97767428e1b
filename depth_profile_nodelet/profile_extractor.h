#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/depth_profile.h"
#include "core/range_scan.h"
#include "depth_profile_nodelet/column_surface.h"

namespace knav {

struct DepthProfileConfig {
  std::string method = "default";
  double range_max_m = 20.0;
  int support_rows = 3;
  double window_codes = 4.0;
  int smoothing_radius_px = 4;
  double smoothing_sigma_px = 2.0;
  double smoothing_sigma_codes = 1.5;
  double scan_fov_deg = 57.0;
  int scan_readings = 640;
  double scan_range_min_m = 0.45;
  std::string scan_frame = "camera_link";

  template <class Visitor>
  void visit(Visitor& v) {
    v.choice(
        "method", method, {"paper", "default"},
        "paper: the smallest depth of a column. default: the nearest surface that several rows support.");
    v.number("range_max_m", range_max_m, 1, 26, "m", "Corrected depth beyond this is no reading.");
    v.integer("support_rows", support_rows, 1, 8, "rows", "default: readings that make a surface.");
    v.number("window_codes", window_codes, 1, 40, "codes",
             "default: how far apart they may lie [disparity codes of 1/8 px].");
    v.integer("smoothing_radius_px", smoothing_radius_px, 0, 20, "px",
              "Bilateral filter: columns to either side; 0 = off.");
    v.number("smoothing_sigma_px", smoothing_sigma_px, 0.1, 20, "px", "Bilateral filter: sd over columns.");
    v.number("smoothing_sigma_codes", smoothing_sigma_codes, 0.1, 40, "codes",
             "Bilateral filter: sd over disparity.");
    v.number("scan_fov_deg", scan_fov_deg, 10, 120, "deg", "Field of view of `scan`.");
    v.integer("scan_readings", scan_readings, 2, 4000, "", "Readings of `scan`.");
    v.number("scan_range_min_m", scan_range_min_m, 0, 2, "m", "range_min of `scan`.");
    v.text("scan_frame", scan_frame, "Nodelet: frame of `scan`: at the camera, x forward, z up.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// Paper section III.C, last paragraph: one depth per column, bilaterally smoothed.
class ProfileExtractor {
 public:
  explicit ProfileExtractor(const DepthProfileConfig& config);

  /// @param sliced  levelled image of FloorRemover: 32FC1 m, NaN invalid
  /// @param profile z and rows are written (`paper`: no rows); free_from, free_to and height_class are taken from the floor (one entry a
  /// column) and
  ///                made to agree with z
  /// @param found   what ColumnSurface::find() found in this very image, if somebody has it: saves finding it
  /// again
  void extract(const cv::Mat& sliced, const PinholeModel& camera, double stamp_s, double camera_height_m,
               const std::vector<float>& free_from_m, const std::vector<float>& free_to_m,
               const std::vector<HeightClass>& height_class, DepthProfile* profile,
               const ColumnSurface* found = nullptr);

 private:
  void smooth(std::vector<float>* z_m);

  DepthProfileConfig config_;
  ColumnSurface surface_;
  std::vector<float> spatial_weight_, inverse_;
};

/// The profile as a planar scan in the levelled camera's frame (x forward, angles to the left): a return,
/// +Inf where the column is free to range_max, else NaN (REP 117).
void scan_from_profile(const DepthProfile& profile, const DepthProfileConfig& config, RangeScan* scan);

}  // namespace knav
