#pragma once

#include <cstdint>
#include <vector>

#include "core/particle_filter.h"
#include "core/pose2.h"

namespace knav {

/// How far odometry may be from the moment that its stamp says.
struct OdometryTimingConfig {
  double stamp_sd_s = 0.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("stamp_sd_s", stamp_sd_s, 0, 1, "s",
             "Odometry that comes with a frame is from up to so much sooner or later (sd), each time anew: a driver that stamps what it has just read, "
             "or passes on what it had. How much it is, is learned; 0 = its stamps are right.");
  }
};

/// Odometry's stamps that are off, estimated along with the pose: each particle carries how far the frame's odometry was from its
/// moment, and moves by the robot's velocity times that. What one frame was behind the next comes too far, so this does not add
/// up along the way as the motion model's noise does. Not in the paper.
class OdometryTiming {
 public:
  explicit OdometryTiming(const OdometryTimingConfig& config) : config_(config), sd_s_(kBegin * config.stamp_sd_s) {}

  bool on() const { return config_.stamp_sd_s > 0.0; }
  /// As if all stamps so far were right; what they usually are off by stays.
  void forget(std::size_t particles);
  /// Takes the last frame's errors out of the particles' poses; the motion model's step comes between this and add().
  void take_out(ParticleSet* particles);
  /// Puts this frame's in. Particle i draws from index i of the stream kOdometryTiming.
  /// @param T_before_after  odometry's step  @param dt_s  its time, > 0
  void add(const Pose2& T_before_after, double dt_s, std::uint64_t seed, std::uint64_t step, ParticleSet* particles);
  /// How far off stamps usually are follows from what the views say of them (expectation maximisation, the last kMemory frames).
  /// @param weight  the particles', after the frame's readings
  void learn(const std::vector<double>& weight);
  /// Follows a resampling. @param parent  each new particle's old index
  void resample(const std::vector<std::uint32_t>& parent);

  double sd_s() const { return sd_s_; }

 private:
  static constexpr double kMemory = 100.0, kBegin = 1.0 / 3.0;

  void move(double direction, ParticleSet* particles);

  OdometryTimingConfig config_;
  double sd_s_, frames_ = 0.0;
  double forward_mps_ = 0.0, sideways_mps_ = 0.0, turn_radps_ = 0.0;  ///< as of late
  std::vector<double> late_s_;                                        ///< one a particle
  std::vector<double> scratch_, cosine_, sine_;
};

}  // namespace knav
