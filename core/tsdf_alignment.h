#pragma once

#include <vector>

#include "core/particle_filter.h"
#include "core/tsdf_grid.h"
#include "core/weighted_points.h"

namespace knav {

/// For each particle the weighted mean over the readings of |F|, F interpolated between the known cells (W =
/// 0 enters no interpolation); the unknown share of a reading's four cells costs `unknown_price` instead.
/// Equation 7, normalised: in [0, 1]. F is quantised to 1/127, a reading's place to 1/256 of a cell. Same bytes with
/// and without SIMD, and with any number of threads.
/// @param vectors  false: plain code even where there is AVX2, for tests
void tsdf_alignment_costs(const TsdfGrid& grid, const WeightedPoints& points_robot, const ParticleSet& particles,
                          float unknown_price, std::vector<float>* cost, int threads = 1, bool vectors = true);

/// Multiplies each reading's weight by (the square of) how many of the hypotheses see it in known cells. What comes newly into view as the
/// robot turns lies in unknown cells whatever the pose; charged the price there, it would hold the turn back.
/// @param hypotheses  how many of the particles are asked, evenly spread
void weigh_by_known_share(const TsdfGrid& grid, const ParticleSet& particles, int hypotheses,
                          WeightedPoints* points_robot);

/// Equation 7 as printed: for each particle the sum over the readings of |F W| in their cell [1 / m^2]; a
/// cell never seen costs nothing.
/// @param mean_weight  receives the mean W [1 / m^2] of the known cells under the particles' readings
void tsdf_paper_costs(const TsdfGrid& grid, const WeightedPoints& points_robot, const ParticleSet& particles,
                      std::vector<float>* cost, float* mean_weight);

}  // namespace knav
