#pragma once

#include <cstdint>

namespace knav {

/// Counter-based random numbers: Philox 4x32-10 (Salmon et al., "Parallel Random Numbers: As Easy as 1, 2, 3",
/// SC 2011). A draw depends on (seed, stream, step, index) only, never on how many draws came before or on which
/// thread asks, so results are the same bytes on any number of threads.
class RandomStream {
 public:
  /// @param seed    the user's parameter
  /// @param stream  which consumer this is (motion noise, resampling, ...), so that none shares numbers
  /// @param step    the consumer's time step
  /// @param index   which item within the step (a particle, a pixel)
  RandomStream(std::uint64_t seed, std::uint32_t stream, std::uint64_t step, std::uint32_t index)
      : key_{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32) ^ (stream * 0x9E3779B9u)},
        counter_{0u, index, static_cast<std::uint32_t>(step), static_cast<std::uint32_t>(step >> 32)} {}

  std::uint32_t bits();
  double uniform();  ///< in [0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  double normal();   ///< mean 0, standard deviation 1
  double normal(double mean, double sd) { return mean + sd * normal(); }

 private:
  void refill();

  std::uint32_t key_[2];
  std::uint32_t counter_[4];
  std::uint32_t block_[4] = {};
  int used_ = 4;
  double spare_normal_ = 0.0;
  bool has_spare_normal_ = false;
};

/// The raw generator: four 32-bit words from a 128-bit counter and a 64-bit key.
void philox4x32_10(const std::uint32_t counter[4], const std::uint32_t key[2], std::uint32_t out[4]);

/// Three standard normal numbers from one draw of RandomStream(seed, stream, step, index), much faster than its
/// normal(): for thousands of particles a frame.
void three_normals(std::uint64_t seed, std::uint32_t stream, std::uint64_t step, std::uint32_t index, double out[3]);

/// Every consumer of random numbers has its number here, so that no two share a stream.
namespace random_stream {
constexpr std::uint32_t kMotion = 1, kResample = 2, kLocalizerMotion = 3, kLocalizerResample = 4,
                        kLocalizerGlobal = 5, kRecovery = 6, kSimDepth = 7, kSimOdometry = 8, kSimDevice = 9,
                        kSimPeople = 10, kSimLidar = 11, kSimBands = 12, kChanges = 13,
                        kBootstrap = 14, kSimInfrared = 15, kSensorBenchmark = 16, kFloorSample = 17, kOdometryErrors = 18, kOdometryTiming = 19,
                        kTest = 100;
}  // namespace random_stream

}  // namespace knav
