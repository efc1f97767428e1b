#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/distance_map.h"
#include "core/particle_filter.h"
#include "core/pose2.h"
#include "core/range_scan.h"
#include "tsdf_localizer/localizer_config.h"
#include "tsdf_localizer/localizer_result.h"

namespace knav {

/// Monte Carlo localization of a planar robot on the true distance map (paper section III.H), with a
/// 360-degree scan and the motion from the local mapper, or with any planar scan and odometry. Finds the pose
/// without a hint, notices when it is lost, and recovers; see docs/localization.md. Not thread safe.
class Localizer {
 public:
  explicit Localizer(const LocalizerConfig& config);
  ~Localizer();
  Localizer(Localizer&&) noexcept;
  Localizer& operator=(Localizer&&) noexcept;

  /// Takes a (new) map. A pose that was known is kept, in doubt until the scans agree. UserError if the map's
  /// size and data disagree.
  void set_map(const DistanceMap& map);
  bool has_map() const;
  const DistanceMap& map() const;

  /// How far a given pose is to be believed.
  enum class Trust {
    kGiven,  ///< somebody says so: ok as soon as the scans agree
    kSaved   ///< it was so: ok when the scans agree here better than elsewhere
  };
  /// Spreads the particles around a pose. UserError on a pose or covariance that is not finite.
  /// @param covariance (x [m], y [m], yaw [rad]) in the map frame
  void initialize(const Pose2& T_map_base, const Eigen::Matrix3d& covariance, Trust trust = Trust::kGiven);
  /// A pose was given, or found: there are particles.
  bool initialized() const;
  /// Forgets the pose and searches the whole map.
  void initialize_globally();
  /// Forgets pose and motion (a clock that jumped back); the map stays.
  void reset();
  /// The next scan is weighed though the robot stands (amcl's request_nomotion_update).
  void force_update();

  /// One scan. Bad input (no finite pose, no rays) changes nothing and says so in the result.
  /// @param T_base_sensor planar pose of the scan's frame on the robot
  /// @param T_local_base  robot pose at the scan's stamp in any frame that drifts slowly: the local mapper's,
  /// or odom
  /// @param epoch         poses of different epochs are unrelated (MotionEstimate.msg)
  /// @param T_odom_base   odometry at the same stamp, if at hand: a guess of the motion across epochs
  const LocalizerResult& update(const RangeScan& scan, const Pose2& T_base_sensor, const Pose2& T_local_base,
                                std::uint32_t epoch, const Pose2* T_odom_base = nullptr);

  const LocalizerResult& result() const;
  /// At the stamp of the last scan that was weighed (LocalizerResult::filter_updated).
  const ParticleSet& particles() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace knav
