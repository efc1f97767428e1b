#include "global_map_builder/drive_refiner.h"

#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <memory>

#include "global_map_builder/submap.h"

namespace knav {
namespace {

MatchConfig match_config() {
  MatchConfig config;
  config.min_surface_m = 1.5;
  config.min_overlap = 0.2;
  config.min_agreement = 0.7;
  return config;
}

}  // namespace

std::vector<PoseGraphEdge> refine_drive(const RefinementConfig& config, const SurfaceConfig& surface,
                                        const Drive& drive, const std::function<void(double)>& progress) {
  std::vector<PoseGraphEdge> edges;
  if (!config.enabled) return edges;
  SurfaceConfig near = surface;
  near.range_max_m = std::min(surface.range_max_m, config.range_max_m);
  near.min_looks = 2;
  const std::vector<Keyframe>& keyframes = drive.keyframes;
  const MatchConfig match = match_config();
  const double heading_sd = config.heading_sd_deg * kPi / 180.0,
               position2 = config.position_sd_m * config.position_sd_m;
  const Eigen::Matrix3d floor = Eigen::Vector3d(position2, position2, heading_sd * heading_sd).asDiagonal();
  const int spans = static_cast<int>(config.spans_m.size());
  std::vector<std::unique_ptr<Submap>> submaps(keyframes.size());
  constexpr std::size_t kBatch =
      64;  // keyframes between two reports; submaps behind the longest span are let go
  for (std::size_t first = 0; first < keyframes.size(); first += kBatch) {
    progress(static_cast<double>(first) / static_cast<double>(keyframes.size()));
    const std::size_t last = std::min(keyframes.size(), first + kBatch);
    tbb::parallel_for(first, last, [&](std::size_t i) {
      submaps[i] = std::make_unique<Submap>(
          near, observations_near(drive, static_cast<int>(i), config.half_length_m, near.limits()));
    });
    std::vector<PoseGraphEdge> found((last - first) * static_cast<std::size_t>(spans));
    tbb::parallel_for(first, last, [&](std::size_t to) {
      for (int span = 0; span < spans; ++span) {
        const double wanted_m = keyframes[to].path_m - config.spans_m[static_cast<std::size_t>(span)];
        if (wanted_m < 0.0) continue;
        std::size_t from = to;
        bool whole = true;
        while (from > 0 && keyframes[from].path_m > wanted_m) whole = whole && !keyframes[from--].after_break;
        if (!whole || from == to || !submaps[from]) continue;
        const Pose2 T_from_to = keyframes[from].T_drive_base.inverse() * keyframes[to].T_drive_base;
        const MatchResult result = align_submaps(match, *submaps[from], *submaps[to], T_from_to);
        // A large step from the mapper's estimate is a slip along something, not its noise.
        if (!result.accepted || distance_m(result.T_from_to, T_from_to) > config.max_change_m) continue;
        PoseGraphEdge& edge =
            found[(to - first) * static_cast<std::size_t>(spans) + static_cast<std::size_t>(span)];
        edge.from = static_cast<int>(from);
        edge.to = static_cast<int>(to);
        edge.T_from_to = result.T_from_to;
        // Ranges bend with a calibration's remains, so that walls seen from elsewhere never quite agree.
        edge.information = (result.information.inverse() + floor).inverse();
      }
    });
    for (const PoseGraphEdge& edge : found) {
      if (edge.to != edge.from) edges.push_back(edge);
    }
    const double longest_m =
        config.spans_m.empty() ? 0.0 : *std::max_element(config.spans_m.begin(), config.spans_m.end());
    for (std::size_t i = 0; i < last; ++i) {
      if (keyframes[i].path_m < keyframes[last - 1].path_m - longest_m - 2.0) submaps[i].reset();
    }
  }
  return edges;
}

}  // namespace knav
