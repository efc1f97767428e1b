#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"

namespace knav {

/// Floor points p [m] in the camera's optical frame satisfy up . p + height_m = 0; a point's height above the
/// floor is up . p + height_m.
struct FloorPlane {
  Eigen::Vector3d up = {0.0, -1.0, 0.0};
  double height_m = 0.0;

  /// The floor (base z = 0) as the mount says.
  static FloorPlane from_mount(const Eigen::Isometry3d& T_base_optical);
};

enum class FloorSource : std::uint8_t { kFrame = 0, kPrevious = 1, kMount = 2 };

struct FloorFitConfig {
  std::string method = "default";
  double tilt_tolerance_deg = 3.0;
  double height_tolerance_m = 0.05;
  double range_max_m = 4.0;
  double noise_codes = 2.0;
  double majority = 0.5;
  int min_rows = 12;
  int min_columns = 40;
  double previous_timeout_s = 2.0;
  int paper_rows = 48;
  double paper_majority = 0.75;

  template <class Visitor>
  void visit(Visitor& v) {
    v.choice("method", method, {"paper", "default", "mount"},
             "paper: majority of the bottom rows, whatever they show. default: only what lies near the "
             "mount's floor. mount: no fit.");
    v.number("tilt_tolerance_deg", tilt_tolerance_deg, 0, 30, "deg",
             "How far the floor may be tilted against the mount.");
    v.number("height_tolerance_m", height_tolerance_m, 0, 0.5, "m",
             "How far it may lie above or below the mount's.");
    v.number("range_max_m", range_max_m, 0.5, 20, "m", "Readings up to here take part in the fit.");
    v.number("noise_codes", noise_codes, 0.1, 50, "codes",
             "rms of a column's readings about its own line, above which it has no vote [disparity codes of "
             "1/8 px].");
    v.number("majority", majority, 0.1, 1, "", "Share of the columns with candidates that must agree.");
    v.integer("min_rows", min_rows, 4, 480, "rows", "Candidates a column needs to be heard.");
    v.integer("min_columns", min_columns, 4, 640, "columns", "Columns that must agree at least.");
    v.number("previous_timeout_s", previous_timeout_s, 0, 60, "s",
             "After this long without a fit the mount's plane is used.");
    v.integer("paper_rows", paper_rows, 4, 480, "rows",
              "paper: the bottom rows of the image that are looked at.");
    v.number("paper_majority", paper_majority, 0.1, 1, "", "paper: `majority`.");
  }
};

/// The floor in one depth frame. Works in inverse depth, which is linear in the pixel for a plane and has
/// uniform noise: 1/z = -(up . ray) / height. Per column a line; a column votes if its line is near the
/// mount's floor and its readings near the line; the voting columns are then fitted jointly.
class FloorPlaneFit {
 public:
  explicit FloorPlaneFit(const FloorFitConfig& config) : config_(config) {}

  struct Result {
    FloorPlane plane;
    FloorSource source = FloorSource::kMount;
    double vote_fraction = 0.0;
  };
  /// @param depth 32FC1 m, NaN invalid, rectified
  Result fit(const cv::Mat& depth, const PinholeModel& camera, double stamp_s,
             const Eigen::Isometry3d& T_base_optical);
  void reset() { has_previous_ = false; }

 private:
  struct Sums {  // per column, of the residual r against the reference plane's inverse depth, y relative to
                 // cy
    std::vector<float> n, y, yy, r, yr, rr;
    void reset(int width);
  };
  bool fit_frame(const cv::Mat& depth, const PinholeModel& camera, const FloorPlane& mount, Result* result);
  void accumulate(const cv::Mat& depth, const PinholeModel& camera, const FloorPlane& reference,
                  double gate_m, double gate_per_m);
  void add_block(const FloorPlane& reference);
  int vote(const PinholeModel& camera, const FloorPlane& reference, int* heard);
  bool solve(const PinholeModel& camera, const FloorPlane& reference, FloorPlane* plane) const;

  FloorFitConfig config_;
  Sums sums_, block_;  // block_: of the rows since the last add_block()
  std::vector<float> candidates_;
  std::vector<std::uint8_t> votes_;
  bool has_previous_ = false;
  double previous_stamp_s_ = 0.0;
  FloorPlane previous_base_;  // in the base frame, so that it follows a camera that tilts
};

}  // namespace knav
