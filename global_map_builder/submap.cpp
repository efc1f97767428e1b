#include "global_map_builder/submap.h"

#include <algorithm>
#include <cmath>

#include "global_map_builder/contour_distance.h"
#include "global_map_builder/map_contour.h"

namespace knav {
namespace {

constexpr double kPointSpacing_m = 0.1;
constexpr double kMinPieceLength_m = 0.15;

struct Box {
  double low_x = 1e300, low_y = 1e300, high_x = -1e300, high_y = -1e300;
  void add(double x, double y) {
    low_x = std::min(low_x, x);
    high_x = std::max(high_x, x);
    low_y = std::min(low_y, y);
    high_y = std::max(high_y, y);
  }
};

void add_observation(const TsdfObservation& o, Box* box) {
  const double c = std::cos(o.T_map_sensor.yaw_rad), s = std::sin(o.T_map_sensor.yaw_rad);
  box->add(o.T_map_sensor.x_m, o.T_map_sensor.y_m);
  for (std::size_t i = 0; i < o.columns(); ++i) {
    const float r = std::max(std::isnan(o.range_m[i]) ? 0.0f : o.range_m[i], o.free_to_m[i]);
    if (!(r > 0.0f)) continue;
    const double x = r * o.direction_x[i], y = r * o.direction_y[i];
    box->add(o.T_map_sensor.x_m + c * x - s * y, o.T_map_sensor.y_m + s * x + c * y);
  }
}

}  // namespace

GridGeometry geometry_for(double resolution_m, const std::vector<TsdfObservation>& observations) {
  Box box;
  for (const TsdfObservation& o : observations) add_observation(o, &box);
  GridGeometry g;
  g.resolution_m = resolution_m;
  if (observations.empty()) return g;
  constexpr int kMargin_cells = 8;
  const auto low = [&](double v) { return static_cast<int>(std::floor(v / resolution_m)) - kMargin_cells; };
  const auto high = [&](double v) { return static_cast<int>(std::ceil(v / resolution_m)) + kMargin_cells; };
  g.origin_x_m = low(box.low_x) * resolution_m;
  g.origin_y_m = low(box.low_y) * resolution_m;
  g.width_cells = high(box.high_x) - low(box.low_x);
  g.height_cells = high(box.high_y) - low(box.low_y);
  return g;
}

Submap::Submap(const SurfaceConfig& surface, const std::vector<TsdfObservation>& observations)
    : geometry_(geometry_for(surface.resolution_m, observations)) {
  DenseTsdf tsdf(geometry_, surface);
  for (const TsdfObservation& o : observations) tsdf.add(o);
  std::vector<float> value(geometry_.cell_count());
  known_.resize(value.size());
  std::vector<std::uint8_t> measured(value.size());
  for (std::size_t i = 0; i < value.size(); ++i) {
    value[i] = tsdf.distance_m(i);
    measured[i] = tsdf.measured(i);
    known_[i] = !std::isnan(value[i]);
  }
  Contour contour = extract_zero_level(geometry_, value, measured);
  remove_short_pieces(kMinPieceLength_m, &contour);
  signed_m_ = contour_distance_m(geometry_, contour);
  for (std::size_t i = 0; i < value.size(); ++i) {
    if (!(value[i] > 0.0f)) signed_m_[i] = -signed_m_[i];  // NaN too
  }
  for (const Point2& p : sample_contour(contour, kPointSpacing_m)) {
    double distance = 0.0;
    Eigen::Vector2d gradient;
    if (!interpolate(p.x_m, p.y_m, &distance, &gradient) || !(gradient.norm() > 0.2)) continue;
    gradient.normalize();
    points_.push_back({static_cast<float>(p.x_m), static_cast<float>(p.y_m), static_cast<float>(gradient.x()),
                       static_cast<float>(gradient.y())});
  }
}

bool Submap::interpolate(double x_m, double y_m, double* distance_m, Eigen::Vector2d* gradient) const {
  const double gx = (x_m - geometry_.origin_x_m) / geometry_.resolution_m - 0.5;
  const double gy = (y_m - geometry_.origin_y_m) / geometry_.resolution_m - 0.5;
  const int ix = static_cast<int>(std::floor(gx)), iy = static_cast<int>(std::floor(gy));
  if (!geometry_.contains(ix, iy) || !geometry_.contains(ix + 1, iy + 1)) return false;
  const double tx = gx - ix, ty = gy - iy;
  const float* v = &signed_m_[geometry_.index(ix, iy)];
  const double v00 = v[0], v10 = v[1], v01 = v[geometry_.width_cells], v11 = v[geometry_.width_cells + 1];
  *distance_m = (1 - ty) * ((1 - tx) * v00 + tx * v10) + ty * ((1 - tx) * v01 + tx * v11);
  gradient->x() = ((1 - ty) * (v10 - v00) + ty * (v11 - v01)) / geometry_.resolution_m;
  gradient->y() = ((1 - tx) * (v01 - v00) + tx * (v11 - v10)) / geometry_.resolution_m;
  return std::isfinite(*distance_m);
}

}  // namespace knav
