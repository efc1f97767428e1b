#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/trajectory.h"

namespace knav {

/// A verified relative pose between two stamps.
struct Relation {
  double from_s = 0.0;
  double to_s = 0.0;
  Pose2 T_from_to;
};

/// Text, `t1 t2 x y z roll pitch yaw` a line (z, roll and pitch are not used). UserError names file and line.
std::vector<Relation> read_relations(const std::string& path);

struct ErrorStatistics {
  int count = 0;
  double translation_mean_m = 0.0;
  double translation_sd_m = 0.0;
  double rotation_mean_deg = 0.0;
  double rotation_sd_deg = 0.0;
  double translation_max_m = 0.0;
};

/// Error over relations after Kuemmerle et al., "On Measuring the Accuracy of SLAM Algorithms" (2009): the
/// transform between estimated and true relation, its translation and rotation taken apart, absolute values.
/// Relations with a stamp the trajectory does not cover (within max_gap_s) are left out.
/// @param max_span_s only relations whose stamps lie closer than this; 0 = all
ErrorStatistics relation_error(const Trajectory& estimate, const std::vector<Relation>& relations, double max_span_s,
                               double max_gap_s = 1.0);

/// The same error over every stretch of the reference that is length_m of path long, one starting at each of its
/// poses.
ErrorStatistics segment_error(const Trajectory& estimate, const Trajectory& reference, double length_m,
                              double max_gap_s = 1.0);

/// Root mean square distance to the reference's positions after the best rigid alignment; `matched` receives how
/// many reference poses the estimate covers.
double absolute_trajectory_error_m(const Trajectory& estimate, const Trajectory& reference, int* matched,
                                   double max_gap_s = 1.0);

/// The rigid transform that best maps the points `from` onto `to` (least squares).
Pose2 best_rigid_transform(const std::vector<Point2>& from, const std::vector<Point2>& to);

}  // namespace knav
