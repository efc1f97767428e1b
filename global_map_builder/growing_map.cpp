#include "global_map_builder/growing_map.h"

#include <cmath>

#include "global_map_builder/submap.h"

namespace knav {
namespace {

constexpr double kMargin_m = 12.0;  // room kept on every side, so that the grid is seldom laid out anew

std::vector<TsdfObservation> observations_of(const Drive& drive, std::size_t first,
                                             const ObservationLimits& limits) {
  std::vector<TsdfObservation> out;
  for (std::size_t i = first; i < drive.frames.size(); ++i) {
    const DriveFrame& frame = drive.frames[i];
    TsdfObservation& o = out.emplace_back();
    std::visit([&](const auto& data) { observation_from(data, limits, &o); }, frame.data);
    o.T_map_sensor = frame.T_drive_base * frame.T_base_sensor;
  }
  return out;
}

bool inside(const GridGeometry& outer, const GridGeometry& inner) {
  const double slack = 1e-6;
  return inner.origin_x_m >= outer.origin_x_m - slack && inner.origin_y_m >= outer.origin_y_m - slack &&
         inner.origin_x_m + inner.width_cells * inner.resolution_m <=
             outer.origin_x_m + outer.width_cells * outer.resolution_m + slack &&
         inner.origin_y_m + inner.height_cells * inner.resolution_m <=
             outer.origin_y_m + outer.height_cells * outer.resolution_m + slack;
}

}  // namespace

GrowingMap::GrowingMap(const SurfaceConfig& surface, double resolution_m) : surface_(surface) {
  surface_.resolution_m = resolution_m;
}

void GrowingMap::update(const Drive& drive) {
  if (taken_ >= drive.frames.size()) return;
  std::vector<TsdfObservation> observations = observations_of(drive, taken_, surface_.limits());
  if (!tsdf_ || !inside(tsdf_->geometry(), geometry_for(surface_.resolution_m, observations))) {
    observations = observations_of(drive, 0, surface_.limits());
    GridGeometry g = geometry_for(surface_.resolution_m, observations);
    const int margin = static_cast<int>(std::ceil(kMargin_m / g.resolution_m));
    g.origin_x_m -= margin * g.resolution_m;
    g.origin_y_m -= margin * g.resolution_m;
    g.width_cells += 2 * margin;
    g.height_cells += 2 * margin;
    tsdf_ = std::make_unique<DenseTsdf>(g, surface_);
  }
  for (const TsdfObservation& o : observations) tsdf_->add(o);
  taken_ = drive.frames.size();
}

OccupancyGrid GrowingMap::grid() const {
  OccupancyGrid grid;
  if (!tsdf_) return grid;
  grid.geometry = tsdf_->geometry();
  grid.value.assign(grid.geometry.cell_count(), -1);
  for (std::size_t i = 0; i < grid.value.size(); ++i) {
    const float d = tsdf_->distance_m(i);
    if (!std::isnan(d)) grid.value[i] = d > 0.0f ? 0 : 100;
  }
  return grid;
}

}  // namespace knav
