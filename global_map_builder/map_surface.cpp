#include "global_map_builder/map_surface.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "global_map_builder/submap.h"

namespace knav {
namespace {

constexpr std::size_t kBatch = 128;  // frames prepared at once, to bound memory
constexpr int kBand_rows = 64;

std::vector<TsdfObservation> prepare(const std::vector<DriveFrame>& frames, std::size_t first,
                                     std::size_t last, const CorrectedDrive& corrected,
                                     const RangeOffset& offset, const ObservationLimits& limits) {
  std::vector<TsdfObservation> out(last - first);
  tbb::parallel_for(first, last, [&](std::size_t i) {
    TsdfObservation& o = out[i - first];
    const auto* profile = std::get_if<DepthProfile>(&frames[i].data);
    if (profile != nullptr && offset.any()) {
      DepthProfile corrected_profile = *profile;
      offset.apply(&corrected_profile);
      observation_from(corrected_profile, limits, &o);
    } else {
      std::visit([&](const auto& data) { observation_from(data, limits, &o); }, frames[i].data);
    }
    o.T_map_sensor = corrected.at(frames[i].stamp_s, frames[i].T_drive_base) * frames[i].T_base_sensor;
  });
  return out;
}

GridGeometry enclosing(const GridGeometry& a, const GridGeometry& b) {
  if (a.cell_count() == 0) return b;
  if (b.cell_count() == 0) return a;
  GridGeometry g = a;
  const auto cells = [&](double v) { return static_cast<int>(std::lround(v / a.resolution_m)); };
  const int low_x = std::min(cells(a.origin_x_m), cells(b.origin_x_m));
  const int low_y = std::min(cells(a.origin_y_m), cells(b.origin_y_m));
  g.width_cells = std::max(cells(a.origin_x_m) + a.width_cells, cells(b.origin_x_m) + b.width_cells) - low_x;
  g.height_cells =
      std::max(cells(a.origin_y_m) + a.height_cells, cells(b.origin_y_m) + b.height_cells) - low_y;
  g.origin_x_m = low_x * a.resolution_m;
  g.origin_y_m = low_y * a.resolution_m;
  return g;
}

void integrate(const MapBuilderConfig& config, const Drive& drive, const CorrectedDrive& corrected,
               const RangeOffset& offset,
               const std::function<void(double)>& report, DenseTsdf* tsdf) {
  const auto& frames = drive.frames;
  const int rows = tsdf->geometry().height_cells, bands = (rows + kBand_rows - 1) / kBand_rows;
  for (std::size_t first = 0; first < frames.size(); first += kBatch) {
    report(static_cast<double>(first) / static_cast<double>(frames.size()));
    const std::size_t last = std::min(frames.size(), first + kBatch);
    const auto batch = prepare(frames, first, last, corrected, offset, config.surface.limits());
    // Every cell belongs to one band and takes the frames in their order: the same sums on any number of
    // threads.
    tbb::parallel_for(0, bands, [&](int band) {
      for (const TsdfObservation& o : batch) {
        tsdf->add(o, band * kBand_rows, std::min(rows, (band + 1) * kBand_rows));
      }
    });
  }
}

}  // namespace

std::vector<CorrectedDrive> corrected_drives(const std::vector<Drive>& drives,
                                             const std::vector<Pose2>& poses) {
  std::vector<CorrectedDrive> out;
  auto first = poses.begin();
  for (const Drive& drive : drives) {
    const auto last = first + static_cast<std::ptrdiff_t>(drive.keyframes.size());
    out.emplace_back(drive.keyframes, std::vector<Pose2>(first, last));
    first = last;
  }
  return out;
}

GridGeometry surface_extent(const MapBuilderConfig& config, const std::vector<Drive>& drives,
                            const std::vector<CorrectedDrive>& corrected) {
  GridGeometry geometry;
  geometry.resolution_m = config.surface.resolution_m;
  for (std::size_t d = 0; d < drives.size(); ++d) {
    const auto& frames = drives[d].frames;
    for (std::size_t first = 0; first < frames.size(); first += kBatch) {
      const std::size_t last = std::min(frames.size(), first + kBatch);
      geometry = enclosing(geometry,
                           geometry_for(config.surface.resolution_m,
                                        prepare(frames, first, last, corrected[d], {}, config.surface.limits())));
    }
  }
  const double width_m = geometry.width_cells * geometry.resolution_m;
  const double height_m = geometry.height_cells * geometry.resolution_m;
  if (std::max(width_m, height_m) > config.size_max_m) {
    throw UserError(
        fmt::format("the map would be {:.0f} x {:.0f} m, more than size_max_m = {:.0f}; check the odometry.",
                    width_m, height_m, config.size_max_m));
  }
  return geometry;
}

MapSurface build_surface(const MapBuilderConfig& config, const std::vector<Drive>& drives,
                         const std::vector<CorrectedDrive>& corrected, const std::vector<RangeOffset>& offset,
                         const GridGeometry& geometry, const std::function<void(double)>& report) {
  DenseTsdf whole(geometry, config.surface);
  for (std::size_t d = 0; d < drives.size(); ++d) {
    const auto part = [&](double fraction) {
      report((static_cast<double>(d) + fraction) / static_cast<double>(drives.size()));
    };
    if (d == 0) {
      integrate(config, drives[d], corrected[d], offset[d], part, &whole);
      continue;
    }
    DenseTsdf newer(geometry, config.surface);
    integrate(config, drives[d], corrected[d], offset[d], part, &newer);
    whole.renew(newer);
  }
  MapSurface surface;
  surface.value_m.resize(geometry.cell_count());
  surface.measured.resize(geometry.cell_count());
  for (std::size_t i = 0; i < surface.value_m.size(); ++i) {
    surface.value_m[i] = whole.distance_m(i);
    surface.measured[i] = whole.measured(i);
  }
  return surface;
}

OccupancyGrid uncorrected_map(const MapBuilderConfig& config, const std::vector<Drive>& drives,
                              const std::vector<CorrectedDrive>& corrected) {
  constexpr std::size_t kStride = 3;
  MapBuilderConfig coarse = config;
  coarse.surface.resolution_m = 2.0 * config.surface.resolution_m;
  coarse.surface.min_looks = 1;
  coarse.size_max_m = 1e9;
  std::vector<Drive> thinned(drives.size());
  std::vector<CorrectedDrive> rigid;
  for (std::size_t d = 0; d < drives.size(); ++d) {
    const Drive& drive = drives[d];
    for (std::size_t i = 0; i < drive.frames.size(); i += kStride)
      thinned[d].frames.push_back(drive.frames[i]);
    // Only put where it began.
    const Keyframe& start = drive.keyframes.front();
    const Pose2 T_map_start = corrected[d].at(start.stamp_s, start.T_drive_base);
    rigid.emplace_back(std::vector<Keyframe>{start}, std::vector<Pose2>{T_map_start});
  }
  OccupancyGrid grid;
  grid.geometry = surface_extent(coarse, thinned, rigid);
  grid.value.assign(grid.geometry.cell_count(), -1);
  constexpr std::size_t kMaxCells = 40'000'000;  // a runaway estimate is not worth the memory
  if (grid.value.size() > kMaxCells) return {};
  const std::vector<float> value =
      build_surface(coarse, thinned, rigid, std::vector<RangeOffset>(drives.size()), grid.geometry, [](double) {}).value_m;
  for (std::size_t i = 0; i < value.size(); ++i) {
    if (!std::isnan(value[i])) grid.value[i] = value[i] > 0.0f ? 0 : 100;
  }
  return grid;
}

}  // namespace knav
