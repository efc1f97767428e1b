#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tsdf_localizer/belief.h"
#include "tsdf_localizer/global_search.h"
#include "tsdf_localizer/health.h"

namespace knav {

/// Decides whether the pose may be believed: searches the whole map while it is in doubt, gives the filter
/// the places found, and ends the doubt when the estimate explains the scans clearly better than any other
/// place does.
class PoseSearch {
 public:
  /// Where the estimate comes from, that is how much better another place must be to unseat it.
  enum class Prior {
    kNone,     ///< from a search: ok only if clearly the best place
    kTracked,  ///< it was right, and the motion since is known, but much of the scan is not explained: people and moved
               ///< furniture do that. Another place must be clearly better again and again, and be the same place each time
    kLocal,    ///< it was right a while ago: ok if no other place is as good
    kGiven     ///< somebody says so: ok unless another place is clearly better
  };

  explicit PoseSearch(const LocalizerConfig& config);

  /// From here on the pose is in doubt. `why` goes into the status.
  void doubt(Prior prior, const std::string& why);
  bool in_doubt() const { return in_doubt_; }
  Prior prior() const { return prior_; }
  /// More than searches speak for the estimate: it was right, or was given, and the motion since is known.
  bool tracked() const { return !in_doubt_ || prior_ != Prior::kNone; }
  const std::string& why() const { return why_; }
  bool searching() const { return search_.running(); }
  double progress() const { return search_.progress(); }
  void end_doubt() { in_doubt_ = false; }

  /// The motion since the last call; hypotheses move along.
  void move(const Pose2& T_before_after);
  /// Nothing links the poses before with those to come: a running search is void.
  void cut();

  /// Starts a search if one is due, or does some work on the one that runs. True if it changed the belief.
  /// @param belief at the scan's stamp less `T_filter_now`, the motion that it has not been told yet
  bool update(double stamp_s, const MapFields& fields, const ScanRays& rays, const Pose2& T_filter_now,
              Belief* belief);

 private:
  bool due(double stamp_s) const;
  bool unseats_tracked(const Pose2& T_rival_filter, const Pose2& T_filter_now, bool alone);
  bool judge(const MapFields& fields, const Pose2& T_filter_now, Belief* belief);

  LocalizerConfig config_;
  GlobalSearch search_;
  bool in_doubt_ = true;
  Prior prior_ = Prior::kNone;
  std::string why_;
  Pose2 T_start_now_;  ///< motion since the scan that is searched with
  double distance_m_ = 0.0, turn_rad_ = 0.0, started_s_ = 0.0;  ///< since the last search began
  bool any_search_ = false;
  int agreements_ = 0;           ///< searches in a row that found the estimate to be the best place
  int defeats_ = 0;              ///< searches in a row that found a better one
  Pose2 T_rival_;                ///< where the better one of the last search is now
  int same_rival_ = 0;           ///< searches in a row, from places apart, that found that one
  int same_alone_ = 0;           ///< those of them that found no other place that is about as good, and this one to explain the scan
  double rival_m_ = 0.0, rival_rad_ = 0.0;  ///< driven and turned since one of them was counted
  std::vector<Hypothesis> now_;  ///< hypotheses at the time of the filter
};

}  // namespace knav
