#include "global_map_builder/map_builder.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "core/config.h"
#include "core/error.h"
#include "global_map_builder/contour_distance.h"
#include "global_map_builder/corrected_drive.h"
#include "global_map_builder/drive_smoother.h"
#include "global_map_builder/submap.h"

namespace knav {
namespace {

using Report = std::function<void(const char*, double)>;

constexpr std::size_t kBatch = 128;  // frames prepared at once, to bound memory
constexpr int kBand_rows = 64;

std::vector<TsdfObservation> prepare(const std::vector<DriveFrame>& frames, std::size_t first,
                                     std::size_t last, const CorrectedDrive& corrected,
                                     const ObservationLimits& limits) {
  std::vector<TsdfObservation> out(last - first);
  tbb::parallel_for(first, last, [&](std::size_t i) {
    TsdfObservation& o = out[i - first];
    std::visit([&](const auto& data) { observation_from(data, limits, &o); }, frames[i].data);
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

GridGeometry extent(const MapBuilderConfig& config, const DriveRecorder& drive,
                    const CorrectedDrive& corrected) {
  GridGeometry geometry;
  geometry.resolution_m = config.surface.resolution_m;
  const auto& frames = drive.frames();
  for (std::size_t first = 0; first < frames.size(); first += kBatch) {
    const std::size_t last = std::min(frames.size(), first + kBatch);
    geometry =
        enclosing(geometry, geometry_for(config.surface.resolution_m,
                                         prepare(frames, first, last, corrected, config.surface.limits())));
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

DenseTsdf integrate(const MapBuilderConfig& config, const DriveRecorder& drive,
                    const CorrectedDrive& corrected, const GridGeometry& geometry, const Report& report) {
  DenseTsdf tsdf(geometry, config.surface);
  const auto& frames = drive.frames();
  const int bands = (geometry.height_cells + kBand_rows - 1) / kBand_rows;
  for (std::size_t first = 0; first < frames.size(); first += kBatch) {
    report("surface", static_cast<double>(first) / static_cast<double>(frames.size()));
    const std::size_t last = std::min(frames.size(), first + kBatch);
    const auto batch = prepare(frames, first, last, corrected, config.surface.limits());
    // Every cell belongs to one band and takes the frames in their order: the same sums on any number of
    // threads.
    tbb::parallel_for(0, bands, [&](int band) {
      for (const TsdfObservation& o : batch) {
        tsdf.add(o, band * kBand_rows, std::min(geometry.height_cells, (band + 1) * kBand_rows));
      }
    });
  }
  return tsdf;
}

/// The part of the grid that is known, with a margin.
struct Crop {
  int low_x, low_y, high_x, high_y;
};
Crop known_part(const GridGeometry& g, const std::vector<float>& value) {
  Crop c{g.width_cells, g.height_cells, 0, 0};
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      if (std::isnan(value[g.index(ix, iy)])) continue;
      c.low_x = std::min(c.low_x, ix);
      c.high_x = std::max(c.high_x, ix + 1);
      c.low_y = std::min(c.low_y, iy);
      c.high_y = std::max(c.high_y, iy + 1);
    }
  }
  if (c.low_x >= c.high_x) throw UserError("nothing was seen within range; the map would be empty.");
  constexpr int kMargin_cells = 10;
  return {std::max(0, c.low_x - kMargin_cells), std::max(0, c.low_y - kMargin_cells),
          std::min(g.width_cells, c.high_x + kMargin_cells),
          std::min(g.height_cells, c.high_y + kMargin_cells)};
}

void crop(const Crop& c, GridGeometry* g, std::vector<float>* value) {
  GridGeometry out = *g;
  out.width_cells = c.high_x - c.low_x;
  out.height_cells = c.high_y - c.low_y;
  out.origin_x_m = g->origin_x_m + c.low_x * g->resolution_m;
  out.origin_y_m = g->origin_y_m + c.low_y * g->resolution_m;
  std::vector<float> cut(out.cell_count());
  for (int iy = 0; iy < out.height_cells; ++iy) {
    for (int ix = 0; ix < out.width_cells; ++ix)
      cut[out.index(ix, iy)] = (*value)[g->index(ix + c.low_x, iy + c.low_y)];
  }
  *g = out;
  *value = std::move(cut);
}

void mark_surface(const Contour& contour, OccupancyGrid* grid) {
  const GridGeometry& g = grid->geometry;
  for (const Point2& p : sample_contour(contour, 0.25 * g.resolution_m)) {
    const int ix = g.cell_x(p.x_m), iy = g.cell_y(p.y_m);
    if (g.contains(ix, iy)) grid->value[g.index(ix, iy)] = 100;
  }
}

/// The cells whose centres the robot's body was on.
std::vector<bool> driven_cells(const GridGeometry& g, const Trajectory& trajectory, double radius_m) {
  std::vector<bool> driven(g.cell_count(), false);
  if (radius_m <= 0.0) return driven;
  Pose2 last;
  bool any = false;
  for (const StampedPose2& pose : trajectory) {
    const Pose2& T = pose.T_map_robot;
    if (any && distance_m(last, T) < 0.5 * g.resolution_m) continue;
    last = T;
    any = true;
    for (int iy = g.cell_y(T.y_m - radius_m); iy <= g.cell_y(T.y_m + radius_m); ++iy) {
      for (int ix = g.cell_x(T.x_m - radius_m); ix <= g.cell_x(T.x_m + radius_m); ++ix) {
        if (g.contains(ix, iy) &&
            std::hypot(g.center_x_m(ix) - T.x_m, g.center_y_m(iy) - T.y_m) <= radius_m) {
          driven[g.index(ix, iy)] = true;
        }
      }
    }
  }
  return driven;
}

}  // namespace

MapBuilder::MapBuilder(const MapBuilderConfig& config, const LocalMapperConfig& mapper)
    : config_(config), drive_(config.drive, mapper) {
  std::vector<std::string> faults = config.validate();
  if (!faults.empty()) throw_faults(faults);
}

BuiltMap MapBuilder::build(const std::function<void(const char*, double)>& progress) {
  if (drive_.frames().empty()) {
    throw UserError(drive_.last_refusal().empty() ? "there are no observations to build a map from."
                                                  : "no observation could be used: " + drive_.last_refusal());
  }
  BuiltMap built;
  auto stage_start = std::chrono::steady_clock::now();
  const auto end_stage = [&](const char* stage) {
    const auto now = std::chrono::steady_clock::now();
    built.stage_s[stage] = std::chrono::duration<double>(now - stage_start).count();
    stage_start = now;
  };
  const Report report = [&](const char* stage, double fraction) {
    if (progress) progress(stage, fraction);
  };

  built.mended_steps = smooth_drive(config_.refinement, config_.graph, config_.surface, &drive_,
                                    [&](double fraction) { report("refinement", fraction); });
  end_stage("refinement");
  ClosureFinder finder(config_, drive_);
  finder.run([&](double fraction) { report("closures", fraction); });
  built.graph = finder.graph();
  built.closures = finder.closures();
  for (const auto& [id, pose] : built.graph.nodes) built.keyframes.push_back(pose);
  end_stage("closures");

  const CorrectedDrive corrected(drive_.keyframes(), built.keyframes);
  GridGeometry geometry = extent(config_, drive_, corrected);
  const DenseTsdf tsdf = integrate(config_, drive_, corrected, geometry, report);
  std::vector<float> value(geometry.cell_count());
  for (std::size_t i = 0; i < value.size(); ++i) value[i] = tsdf.distance_m(i);
  crop(known_part(geometry, value), &geometry, &value);
  end_stage("surface");

  report("distance", 0.0);
  built.contour = extract_zero_level(geometry, value);
  remove_short_pieces(config_.min_contour_piece_m, &built.contour);
  MapDirectory& map = built.map;
  map.distance.geometry = geometry;
  map.distance.distance_m = config_.distance == "paper" ? ray_traced_distance_m(geometry, value, 3600)
                                                        : contour_distance_m(geometry, built.contour);

  const Pose2 T_start_odom = drive_.odometry().front().T_map_robot.inverse();
  for (std::size_t i = 0; i < drive_.trajectory().size(); ++i) {
    const StampedPose2& pose = drive_.trajectory()[i];
    map.trajectory.push_back({pose.stamp_s, corrected.at(pose.stamp_s, pose.T_map_robot)});
    built.odometry.push_back({pose.stamp_s, T_start_odom * drive_.odometry()[i].T_map_robot});
  }

  const std::vector<bool> driven = driven_cells(geometry, map.trajectory, config_.robot_radius_m);
  map.occupancy.geometry = geometry;
  map.occupancy.value.assign(value.size(), -1);
  for (std::size_t i = 0; i < value.size(); ++i) {
    float& d = map.distance.distance_m[i];
    if (std::isnan(value[i]) && driven[i]) {
      map.occupancy.value[i] = 0;
    } else if (std::isnan(value[i])) {
      d = std::numeric_limits<float>::quiet_NaN();
    } else if (value[i] > 0.0f) {
      map.occupancy.value[i] = 0;
    } else {
      d = -d;
    }
  }
  mark_surface(built.contour, &map.occupancy);
  map.keepout.geometry = geometry;
  map.keepout.value.assign(geometry.cell_count(), 0);
  end_stage("distance");

  built.drive = drive_.trajectory();
  return built;
}

}  // namespace knav
