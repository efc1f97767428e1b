#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/depth_profile.h"
#include "depth_profile_nodelet/column_surface.h"
#include "depth_profile_nodelet/floor_plane_fit.h"
#include "depth_profile_nodelet/row_warp.h"

namespace knav {

struct FloorRemovalConfig {
  FloorFitConfig fit;
  double slice_bottom_m = 0.03;
  double slice_bottom_per_m = 0.004;
  double slice_top_m = 2.0;
  double floor_range_m = 6.0;
  double view_near_m = 0.5;
  bool free_without_floor = false;
  std::string base_frame = "base_link";
  double tf_timeout_s = 0.1;

  template <class Visitor>
  void visit(Visitor& v) {
    v.group("fit", fit, "Finding the floor.");
    v.number("slice_bottom_m", slice_bottom_m, 0.005, 0.5, "m",
             "What is lower at the camera's foot is floor.");
    v.number("slice_bottom_per_m", slice_bottom_per_m, 0, 0.1, "m/m",
             "The slice's bottom rises with distance as noise does.");
    v.number("slice_top_m", slice_top_m, 0.1, 10, "m", "What is higher is ignored.");
    v.number("floor_range_m", floor_range_m, 1, 20, "m",
             "The floor must be seen out to here for a column to be free to its surface.");
    v.number("view_near_m", view_near_m, 0.1, 5, "m",
             "An obstacle that leaves the view before it is this near is low or high.");
    v.flag("free_without_floor", free_without_floor,
           "Take what the camera's own height sweeps as free although no floor is seen (a hand-held camera). "
           "Not for driving.");
    v.text("base_frame", base_frame, "Nodelet: the TF frame whose z = 0 is the floor.");
    v.number("tf_timeout_s", tf_timeout_s, 0, 1, "s", "Nodelet: how long a frame waits for the camera's TF.");
  }
  std::vector<std::string> validate() const {
    std::vector<std::string> faults;
    if (slice_top_m <= slice_bottom_m)
      faults.push_back("'slice_top_m' must be greater than 'slice_bottom_m'.");
    return faults;
  }
};

/// What FloorRemover says about a frame besides the image. Columns are the levelled image's.
struct FloorResult {
  FloorPlane plane;  ///< in the camera's optical frame
  FloorSource source = FloorSource::kMount;
  double vote_fraction = 0.0;
  /// Levelled forward distance, NaN = nothing seen free. Where free_to reaches the nearest surface it ends at
  /// the far side of that surface's noise; ProfileExtractor ends it at the surface.
  std::vector<float> free_from_m, free_to_m;
  std::vector<HeightClass> height_class;  ///< of the nearest supported obstacle, or kBlind
};

/// Paper section III.C: takes the floor and what is above 2 m out of the image and levels the rest: each kept
/// pixel holds the distance along the camera's forward axis parallel to the floor and stands in the column (u
/// - cx) / fx = right / forward of that levelled camera.
///
/// Free space. Along a column the floor is followed from the lowest row up until the first obstacle or gap:
/// that far, every height was really seen free (free_from ... c). A level camera 0.5 m above the floor sees
/// it from 1.28 m on, so free_from says so. Grazing floor fades into noise at 6-8 m, while a wall answers out
/// to 20 m. So the interval goes on to the nearest supported surface z when all of these hold:
///  - the floor was followed to floor_range_m, or to within reach of the surface's foot;
///  - at least half of the rows that sweep the heights between the floor at floor_range_m and the camera's
///  own height
///    answered, so whatever stands there higher than the sweep's lower edge would have been seen;
///  - no reading below the floor (stairs down, a hole: c is the edge) in the column.
/// Beyond floor_range_m this says nothing about obstacles of class kLow: a mapper must not erase those there,
/// nor kLow and kHigh in the blind zone before free_from (or where the view's upper edge is below them). A
/// kMiddle obstacle stays in view by definition, so anything seen at z shows it gone also nearer than
/// free_from. Without a surface (nothing answers up to 20 m) the interval ends at c. Without floor there is
/// none, unless free_without_floor says that a hand-held camera's sweep shall do.
class FloorRemover {
 public:
  explicit FloorRemover(const FloorRemovalConfig& config);

  /// @param depth          32FC1 m, NaN invalid, rectified
  /// @param T_base_optical the camera's optical frame in the base; base z = 0 is the floor
  /// @param sliced         32FC1 m; allocated only when its size changes
  void process(const cv::Mat& depth, const PinholeModel& camera, double stamp_s,
               const Eigen::Isometry3d& T_base_optical, cv::Mat* sliced, FloorResult* result);
  /// The nearest surface of each column of the newest sliced image.
  const ColumnSurface& surface() const { return surface_; }
  /// Forgets the previous floor (the clock jumped).
  void reset() { fit_.reset(); }

 private:
  struct Columns {  // one entry per column
    std::vector<float> free_from_m, free_to_m, alive, floor_rows, below_rows, sweep_rows, sweep_seen, seen_rows;
    void reset(int width);
  };
  void slice_rows(const cv::Mat& depth, const PinholeModel& camera, const FloorPlane& plane, cv::Mat* sliced);
  void conclude(const PinholeModel& camera, const FloorPlane& plane, const cv::Mat& sliced,
                FloorResult* result);
  void classify(const PinholeModel& camera, const FloorPlane& plane, const cv::Mat& sliced);

  FloorRemovalConfig config_;
  FloorPlaneFit fit_;
  ColumnSurface surface_;
  RowWarp warp_;
  Columns columns_;
  std::vector<float> row_z_m_, source_x_;
  std::vector<float> low_seen_, middle_seen_, high_seen_;
};

}  // namespace knav
