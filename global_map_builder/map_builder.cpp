#include "global_map_builder/map_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "core/config.h"
#include "core/error.h"
#include "global_map_builder/closure_finder.h"
#include "global_map_builder/closure_review.h"
#include "global_map_builder/contour_distance.h"
#include "global_map_builder/drive_smoother.h"
#include "global_map_builder/joint_refiner.h"
#include "global_map_builder/map_occupancy.h"
#include "global_map_builder/map_surface.h"
#include "global_map_builder/scan_settler.h"

namespace knav {
namespace {

using Report = std::function<void(const char*, double)>;

/// The part of the grid that is known or was driven on, with a margin.
struct Crop {
  int low_x, low_y, high_x, high_y;
};
Crop known_part(const GridGeometry& g, const std::vector<float>& value, const std::vector<bool>& driven) {
  Crop c{g.width_cells, g.height_cells, 0, 0};
  bool any_known = false;
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      const bool known = !std::isnan(value[g.index(ix, iy)]);
      if (!known && !driven[g.index(ix, iy)]) continue;
      any_known = any_known || known;
      c.low_x = std::min(c.low_x, ix);
      c.high_x = std::max(c.high_x, ix + 1);
      c.low_y = std::min(c.low_y, iy);
      c.high_y = std::max(c.high_y, iy + 1);
    }
  }
  if (!any_known) throw UserError("nothing was seen within range; the map would be empty.");
  constexpr int kMargin_cells = 10;
  return {std::max(0, c.low_x - kMargin_cells), std::max(0, c.low_y - kMargin_cells),
          std::min(g.width_cells, c.high_x + kMargin_cells),
          std::min(g.height_cells, c.high_y + kMargin_cells)};
}

GridGeometry cropped(const Crop& c, const GridGeometry& g) {
  GridGeometry out = g;
  out.width_cells = c.high_x - c.low_x;
  out.height_cells = c.high_y - c.low_y;
  out.origin_x_m = g.origin_x_m + c.low_x * g.resolution_m;
  out.origin_y_m = g.origin_y_m + c.low_y * g.resolution_m;
  return out;
}

template <class Value>
void crop(const Crop& c, const GridGeometry& g, std::vector<Value>* value) {
  const GridGeometry out = cropped(c, g);
  std::vector<Value> cut(out.cell_count());
  for (int iy = 0; iy < out.height_cells; ++iy) {
    for (int ix = 0; ix < out.width_cells; ++ix)
      cut[out.index(ix, iy)] = (*value)[g.index(ix + c.low_x, iy + c.low_y)];
  }
  *value = std::move(cut);
}

/// One trajectory in the order of stamps; where two drives' clocks overlap, the newer one's.
Trajectory joined(const std::vector<Trajectory>& parts) {
  Trajectory out;
  for (const Trajectory& part : parts) {
    if (part.empty()) continue;
    const double first_s = part.front().stamp_s, last_s = part.back().stamp_s;
    out.erase(
        std::remove_if(out.begin(), out.end(),
                       [&](const StampedPose2& p) { return p.stamp_s >= first_s && p.stamp_s <= last_s; }),
        out.end());
    const auto place = std::lower_bound(out.begin(), out.end(), first_s,
                                        [](const StampedPose2& p, double s) { return p.stamp_s < s; });
    out.insert(place, part.begin(), part.end());
  }
  return out;
}

/// The node that a line of the list means.
int node_of(const DriveSet& set, int drive, double stamp_s, const std::string& where) {
  constexpr double kSame_s = 0.005;
  if (drive < 0 || drive >= set.count())
    throw UserError(fmt::format("{}: there is no drive {}.", where, drive));
  for (int node = set.first(drive); node < set.first(drive + 1); ++node) {
    if (std::fabs(set.keyframe(node).stamp_s - stamp_s) < kSame_s) return node;
  }
  throw UserError(fmt::format(
      "{}: there is no keyframe at {:.3f} s in drive {}; is the list of another recording or configuration?",
      where, stamp_s, drive));
}

std::vector<ClosureVerdict> verdicts_of(const std::vector<ListedClosure>& list, const DriveSet& set) {
  std::vector<ClosureVerdict> out;
  for (const ListedClosure& line : list) {
    ClosureVerdict v;
    v.from = node_of(set, line.from_drive, line.from_stamp_s, line.where);
    v.to = node_of(set, line.to_drive, line.to_stamp_s, line.where);
    if (v.from >= v.to) throw UserError(line.where + ": 'from' must be the earlier of the two visits.");
    v.allow = line.allow;
    v.T_from_to = line.T_from_to;
    v.has_transform = line.has_transform;
    out.push_back(v);
  }
  return out;
}

OccupancyGrid on_lattice(const OccupancyGrid& grid, const GridGeometry& geometry) {
  OccupancyGrid out;
  out.geometry = geometry;
  out.value.assign(geometry.cell_count(), 0);
  for (int iy = 0; iy < geometry.height_cells; ++iy) {
    for (int ix = 0; ix < geometry.width_cells; ++ix) {
      const int x = grid.geometry.cell_x(geometry.center_x_m(ix)),
                y = grid.geometry.cell_y(geometry.center_y_m(iy));
      if (grid.geometry.contains(x, y))
        out.value[geometry.index(ix, iy)] = grid.value[grid.geometry.index(x, y)];
    }
  }
  return out;
}

}  // namespace

MapBuilder::MapBuilder(const MapBuilderConfig& config, const LocalMapperConfig& mapper)
    : config_(config), mapper_(mapper), recorder_(std::make_unique<DriveRecorder>(config.drive, mapper)) {
  std::vector<std::string> faults = config.validate();
  if (!faults.empty()) throw_faults(faults);
}

void MapBuilder::extend(MapRecord record, MapDirectory map) {
  old_ = std::move(record);
  old_map_ = std::move(map);
}

void MapBuilder::end_drive() {
  if (!recorder_->drive().keyframes.empty()) drives_.push_back(recorder_->take_drive());
}

void MapBuilder::begin_drive(const std::string& name) {
  end_drive();
  recorder_ = std::make_unique<DriveRecorder>(config_.drive, mapper_);
  recorder_->set_name(name);
}

BuiltMap MapBuilder::build(const std::function<void(const char*, double)>& progress) {
  const std::string refusal = recorder_->last_refusal();
  end_drive();
  for (const Drive& drive : drives_) {
    if (!drive.frames.empty()) continue;
    throw UserError((drive.name.empty() ? "" : drive.name + ": ") + "no observation of it can be mapped.");
  }
  if (drives_.empty()) {
    throw UserError(refusal.empty() ? "there are no observations to build a map from."
                                    : "no observation could be used: " + refusal);
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

  for (Drive& drive : drives_) {
    built.mended_steps += smooth_drive(config_.refinement, config_.graph, config_.surface, &drive,
                                       [&](double fraction) { report("refinement", fraction); });
    built.settled_keyframes +=
        settle_scans(config_.settling, config_.joint, &drive, [&](double fraction) { report("settling", fraction); });
  }
  end_stage("refinement");

  built.old_drives = static_cast<int>(old_.drives.size());
  std::vector<Drive>& drives = built.record.drives;
  drives = std::move(old_.drives);
  for (Drive& drive : drives_) drives.push_back(std::move(drive));
  drives_.clear();
  {
    const DriveSet set(drives);
    ClosureFinder finder(config_, set);
    finder.hold(old_.T_map_keyframe, old_.closures);
    finder.set_verdicts(verdicts_of(list_, set));
    finder.run([&](double fraction) { report("closures", fraction); });
    built.graph = finder.graph();
    built.record.closures = finder.closures();
  }
  end_stage("closures");

  // Without a closure nothing holds the far end of a drive against a few wrong pairs (seen: 0.25 to 0.41 m).
  JointRefinementConfig fitting = config_.joint;
  fitting.enabled = fitting.enabled && std::any_of(built.record.closures.begin(), built.record.closures.end(),
                                                   [](const Closure& c) { return c.accepted; });
  const auto fit = [&] {
    return refine_jointly(fitting, drives, built.graph, config_.graph.robust_scale,
                          [&](double fraction) { report("fitting", fraction); });
  };
  JointRefinement joint = fit();
  if (joint.kept && refuse_contradicted(config_.closures, joint.T_map_keyframe, &built.graph, &built.record.closures)) {
    for (auto& [id, pose] : built.graph.nodes) pose = joint.T_map_keyframe[static_cast<std::size_t>(id)];
    const JointRefinement again = fit();
    if (again.kept) joint = again;
  }
  built.record.T_map_keyframe = joint.T_map_keyframe;
  if (joint.kept) built.fitted_pairs = joint.pairs;
  for (auto& [id, pose] : built.graph.nodes) pose = joint.T_map_keyframe[static_cast<std::size_t>(id)];
  end_stage("fitting");

  const std::vector<CorrectedDrive> corrected = corrected_drives(drives, built.record.T_map_keyframe);
  GridGeometry geometry = surface_extent(config_, drives, corrected);
  MapSurface surface = build_surface(config_, drives, corrected, joint.offset, geometry,
                                     [&](double fraction) { report("surface", fraction); });
  std::vector<Trajectory> trajectories;
  std::vector<bool> driven(geometry.cell_count(), false);
  for (std::size_t d = 0; d < drives.size(); ++d) {
    Trajectory& trajectory = trajectories.emplace_back();
    for (const StampedPose2& pose : drives[d].trajectory) {
      trajectory.push_back({pose.stamp_s, corrected[d].at(pose.stamp_s, pose.T_map_robot)});
    }
    if (config_.robot_radius_m > 0.0) mark_driven(geometry, trajectory, config_.robot_radius_m + config_.driven_margin_m, &driven);
  }
  const Crop part = known_part(geometry, surface.value_m, driven);
  crop(part, geometry, &driven);
  crop(part, geometry, &surface.value_m);
  crop(part, geometry, &surface.measured);
  geometry = cropped(part, geometry);
  const std::vector<float>& value = surface.value_m;
  built.before = uncorrected_map(config_, drives, corrected);
  end_stage("surface");

  report("distance", 0.0);
  built.contour = extract_zero_level(geometry, value, surface.measured);
  remove_short_pieces(config_.min_contour_piece_m, &built.contour);
  MapDirectory& map = built.map;
  map.distance.geometry = geometry;
  map.distance.distance_m = config_.distance == "paper" ? ray_traced_distance_m(geometry, value, 3600)
                                                        : contour_distance_m(geometry, built.contour);

  map.trajectory = joined(trajectories);
  built.drive = drives.back().trajectory;
  const Pose2 T_start_odom = drives.back().odometry.front().T_map_robot.inverse();
  for (const StampedPose2& pose : drives.back().odometry) {
    built.odometry.push_back({pose.stamp_s, T_start_odom * pose.T_map_robot});
  }

  map.occupancy = occupancy_from_surface(geometry, value, driven, built.contour, config_.min_contour_piece_m,
                                         &map.distance.distance_m);
  map.keepout.geometry = geometry;
  map.keepout.value.assign(geometry.cell_count(), 0);
  if (built.old_drives > 0) {
    map.keepout = on_lattice(old_map_.keepout, geometry);
    map.places = old_map_.places;
    built.changes =
        find_changes(old_map_.occupancy, map.occupancy, config_.surface.change_m, config_.min_change_m);
  }
  end_stage("distance");
  return built;
}

}  // namespace knav
