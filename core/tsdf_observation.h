#pragma once

#include <cstdint>
#include <vector>

#include "core/depth_profile.h"
#include "core/pose2.h"
#include "core/range_scan.h"

namespace knav {

/// How the truncation of the signed distance grows with the range r of the surface, as the sensor's noise
/// does: mu(r) = base (a scan: scan_base) + per_range_squared r^2, at most `limit` (paper section III.D: "scaled with the
/// distance to the obstacle along the ray"). A Kinect's disparity noise is about 0.0015 r^2.
struct TruncationConfig {
  double base_m = 0.25;
  double per_range_squared = 0.006;
  double limit_m = 2.0;
  double behind_full = 0.3;
  int behind_power = 4;
  double edge_width_m = 0.15;
  double edge_behind = 0.25;
  double cut_front = 0.125;
  double scan_base_m = 0.4;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("base_m", base_m, 0.05, 5, "m", "DepthProfile: truncation at range 0.");
    v.number("per_range_squared", per_range_squared, 0, 0.1, "1/m", "Its growth with the range squared.");
    v.number("limit_m", limit_m, 0.05, 10, "m", "Its largest value.");
    v.number(
        "behind_full", behind_full, 0, 0.95, "",
        "Behind a surface the full weight holds for this share of the truncation (noise reaches there) ...");
    v.integer("behind_power", behind_power, 0, 16, "",
              "... and falls beyond it to nothing with this power of the rest. 0 = the paper's full weight "
              "throughout, "
              "which thickens thin walls that are seen from both sides.");
    v.number("edge_width_m", edge_width_m, 0, 1, "m",
             "DepthProfile: so near to an edge, beside which the view reaches on, a ray may leave a thing by its side: there a surface says "
             "less about what is behind it. 0 = the same everywhere (the paper's).");
    v.number("edge_behind", edge_behind, 0, 1, "", "Namely for this share of the truncation.");
    v.number("cut_front", cut_front, 0, 1, "",
             "DepthProfile: of a low thing before which no floor was seen the view's lower edge may have cut the front away: before what is "
             "seen of it the reading counts for this share of the truncation only. 1 = all of it (the paper's).");
    v.number("scan_base_m", scan_base_m, 0.05, 5, "m",
             "LaserScan: truncation at range 0. Scans come seldom and see far, so that hypotheses lie farther apart, and F has to slope as far.");
  }
  float at(float range_m, bool scan = false) const {
    const float mu = static_cast<float>(scan ? scan_base_m : base_m) + static_cast<float>(per_range_squared) * range_m * range_m;
    const auto limit = static_cast<float>(limit_m);
    return mu < limit ? mu : limit;
  }
};

/// One profile or scan as the grid takes it: per column the ranges along the column's ray, from a known pose.
/// All that integrating needs is in here, so that removing recomputes exactly what was added.
struct TsdfObservation {
  double stamp_s = 0.0;
  std::uint32_t sequence = 0;  ///< rises by one with every observation of a grid, from 1
  float age_clock_s = 0.0f;    ///< the window's clock when it was taken
  Pose2 T_map_sensor;

  bool pinhole = true;  ///< columns evenly spaced on an image row; otherwise in angle
  float fx_px = 0.0f, cx_px = 0.0f;
  float angle_min_rad = 0.0f, angle_increment_rad = 0.0f;

  // One entry per column.
  std::vector<float> direction_x, direction_y;  ///< unit vector of the ray in the sensor's frame
  std::vector<float> range_m;                   ///< NaN: no surface
  std::vector<float> truncation_m;              ///< mu(range)
  std::vector<float> inverse_truncation_per_m;  ///< 1 / mu
  float behind_slope = 1.0f;                    ///< 1 / (1 - behind_full), see TruncationConfig
  int behind_power = 0;
  std::vector<float> behind_limit;              ///< where F is less, the column says nothing: -1, near an edge more
  bool any_edge = false;
  std::vector<float> front_limit;               ///< where F is not less, the column says nothing: 1, at a low thing's cut front less
  bool any_cut = false;
  /// -1: the surface is a low or a high thing (HeightClass), which leaves the view as the robot drives up to it; 0: not.
  std::vector<std::int32_t> standing;
  bool any_standing = false;
  std::vector<std::uint8_t> rows;             ///< of the image that show the surface (DepthProfile); empty: not known
  std::vector<float> free_from_m, free_to_m;  ///< carved between these; free_to < free_from: nothing
  /// Between these nothing stands within a margin on either side of the ray.
  std::vector<float> clear_from_m, clear_to_m;
  /// From every column on over eight: between these all of them saw free space, before any surface's support.
  std::vector<float> free_from_8_m, free_to_8_m;
  float reach_m = 0.0f;  ///< no cell farther than this is touched

  std::size_t columns() const { return range_m.size(); }
  int valid_ranges() const;
  /// True if what the column's surface belongs to may begin nearer than it says.
  bool cut(std::size_t column) const { return front_limit[column] < 1.0f; }
};

/// What of a frame is used.
struct ObservationLimits {
  double range_min_m = 0.3;
  double range_max_m = 20.0;
  double scan_free_beyond_m = 0.0;  ///< how far a scan's +Inf counts as seen free
  double clear_margin_m = 0.1;      ///< lateral, see TsdfObservation::clear_to_m
  TruncationConfig truncation;
};

/// Free space of a profile lies between its free_from and free_to. Reuses the memory of *out.
void observation_from(const DepthProfile& profile, const ObservationLimits& limits, TsdfObservation* out);
/// Free space of a scan is the whole ray up to its return.
void observation_from(const RangeScan& scan, const ObservationLimits& limits, TsdfObservation* out);

}  // namespace knav
