#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/pose2.h"
#include "global_map_builder/submap.h"

namespace knav {

struct MatchConfig {
  double min_surface_m = 4.0;
  double min_overlap = 0.35;
  double min_agreement = 0.8;
  double max_residual_m = 0.08;
  double max_rival = 0.85;
  double rival_distance_m = 0.5;
  double rival_angle_deg = 8.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("min_surface_m", min_surface_m, 0.5, 100, "m", "Length of wall that must coincide.");
    v.number("min_overlap", min_overlap, 0, 1, "",
             "Share of a submap's surface that the other has seen, at least.");
    v.number("min_agreement", min_agreement, 0, 1, "",
             "Share of that which must lie on the other's surface.");
    v.number("max_residual_m", max_residual_m, 0.005, 1, "m", "Root mean square distance of what coincides.");
    v.number("max_rival", max_rival, 0, 1, "", "Another alignment may score this share of the best at most.");
    v.number("rival_distance_m", rival_distance_m, 0.1, 10, "m",
             "Alignments nearer than this are the same ...");
    v.number("rival_angle_deg", rival_angle_deg, 1, 90, "deg", "... if they also differ by less than this.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// Where to look for an alignment.
struct MatchWindow {
  double radius_m = 3.0;
  double angle_rad = 0.35;
};

struct MatchResult {
  bool accepted = false;
  std::string reason;  ///< why not
  Pose2 T_from_to;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< of the error as PoseGraphEdge has it
  double score = 0.0;                                     ///< 0 ... 1
  double overlap = 0.0;                                   ///< the smaller of both directions
  double agreement = 0.0;                                 ///< the smaller of both directions
  double residual_m = 0.0;
  double surface_m = 0.0;
  double rival = 0.0;  ///< score of the next best alignment, relative to the best
};

/// Lays submap `to` on submap `from`: exhaustive search over the window, the best few alignments refined, the
/// best verified by overlap, agreement and residual in both directions and by having no rival. A direction
/// that the walls leave open (along a corridor) is no rival, but gets little information.
MatchResult match_submaps(const MatchConfig& config, const Submap& from, const Submap& to,
                          const Pose2& T_from_to, const MatchWindow& window);

/// The same from a good guess, without a search: for places that follow each other along the drive. Finer
/// than the mapper's estimate, because all readings count at once and nothing is sampled.
MatchResult align_submaps(const MatchConfig& config, const Submap& from, const Submap& to,
                          const Pose2& T_from_to);

}  // namespace knav
