#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/particle_filter.h"
#include "tsdf_localizer/map_fields.h"
#include "tsdf_localizer/pose_check.h"
#include "tsdf_localizer/scan_rays.h"

namespace knav {

/// A place where the scan may have been taken.
struct Hypothesis {
  Pose2 T_map_base;
  double cost = 1.0;     ///< PoseCheck::cost after refinement
  double support = 0.0;  ///< PoseCheck::support
  bool tracked = false;  ///< more than this scan speaks for it: it may lie where the map has something
  std::uint32_t explained = 0;  ///< PoseCheck::explained
};

/// Matches one scan against the whole map: all free places x all headings on a coarse field; the best of each
/// neighbourhood refined on the fine one; each then checked ray by ray. No random numbers; the work is cut
/// into steps of a bounded number of map reads, so that no update of the localizer takes long.
class GlobalSearch {
 public:
  GlobalSearch(const GlobalSearchConfig& search, const MeasurementConfig& measurement,
               const HealthConfig& health);

  /// @param seeds poses tried beside the grid's, e.g. the current estimate
  /// @param seeds_tracked they may lie where the map has something: a robot that drove there, tracked all the way, stands where
  /// something was taken away; a place that only searches speak for is none then
  void start(const MapFields& fields, const ScanRays& rays, const std::vector<Pose2>& seeds, bool seeds_tracked);
  void cancel() { stage_ = Stage::kIdle; }
  bool running() const { return stage_ != Stage::kIdle; }
  /// Some more work; true when this step finished the search. `fields` as in start().
  bool step(const MapFields& fields);
  /// Fraction done of the stage of trying places, for messages.
  double progress() const;
  /// Distinct places, best first. Valid after step() returned true, until start().
  const std::vector<Hypothesis>& hypotheses() const { return hypotheses_; }
  /// The seeds as they were given, in their order, however many places are better. Valid as hypotheses().
  const std::vector<Hypothesis>& seeds() const { return seeds_; }

 private:
  enum class Stage { kIdle, kCoarse, kRefine };
  struct Best {
    float cost = 2.0f;
    float x_m = 0.0f, y_m = 0.0f, yaw_rad = 0.0f;
  };
  std::size_t try_places(const MapFields& fields);
  void choose_candidates(const MapFields& fields);
  void check(const MapFields& fields, Hypothesis* hypothesis) const;
  std::size_t refine(const MapFields& fields, Hypothesis* hypothesis);
  void rank();

  GlobalSearchConfig config_;
  MeasurementConfig measurement_;
  HealthConfig health_;
  Stage stage_ = Stage::kIdle;
  ScanRays coarse_rays_, fine_rays_;
  std::size_t headings_ = 0, next_pose_ = 0, pose_count_ = 0, next_candidate_ = 0;
  int bins_x_ = 0, bins_y_ = 0;
  std::vector<Best> best_of_bin_;  ///< per square of 1 m and sector of 30 deg: keeps the candidates diverse
  std::vector<Hypothesis> candidates_, hypotheses_, seeds_;
  ParticleSet poses_;
  std::vector<float> cost_;
};

/// The same place, for telling hypotheses apart.
bool same_place(const Pose2& a, const Pose2& b);

}  // namespace knav
