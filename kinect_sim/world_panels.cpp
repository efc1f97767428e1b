#include <Eigen/Geometry>
#include <cmath>

#include "kinect_sim/world_parts.h"

namespace knav {
namespace {

constexpr double kDegree = kPi / 180.0;
constexpr double kThickness_m = 0.001;  ///< before the wall it hangs on, so that it is not one with it

/// Where a panel hangs. In its own frame x points right and y up as seen from its front, z out of it.
Eigen::Isometry3d read_place(YamlMap& map) {
  const Point2 at = map.point("at");
  const double yaw = map.number("yaw_deg", -360, 360) * kDegree,
               tilt = map.number("tilt_deg", -80, 80, 0.0) * kDegree;
  const double height = map.number("height_m", 0, 20);
  // Facing yaw: x_world = R(yaw) (0, -1, 0) would be to the left of one who looks out of it, right of one who
  // looks at it.
  Eigen::Matrix3d R_facing_panel;
  R_facing_panel << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix() * R_facing_panel *
               Eigen::AngleAxisd(-tilt, Eigen::Vector3d::UnitX()).toRotationMatrix();
  T.translation() << at.x_m, at.y_m, height;
  T.translation() += kThickness_m * T.linear().col(2);
  return T;
}

void add(const Eigen::Isometry3d& T, const std::vector<Point2>& corners, Material material,
         std::vector<Panel>* panels) {
  Panel panel;
  panel.material = material;
  for (const Point2& corner : corners)
    panel.corners.push_back(T * Eigen::Vector3d(corner.x_m, corner.y_m, 0.0));
  panels->push_back(panel);
}

void add_rectangle(const Eigen::Isometry3d& T, double x0, double y0, double x1, double y1, Material material,
                   std::vector<Panel>* panels) {
  add(T, {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}, material, panels);
}

}  // namespace

void read_chessboard(YamlMap& map, std::vector<Panel>* panels) {
  const Eigen::Isometry3d T = read_place(map);
  const int columns = static_cast<int>(map.number("columns", 3, 40)),
            rows = static_cast<int>(map.number("rows", 3, 40));
  const double square = map.number("square_m", 0.005, 0.5), margin = map.number("margin_m", 0.0, 1.0, square);
  map.text("name", "");
  map.finish();
  const double width = columns * square, height = rows * square, left = -width / 2, low = -height / 2;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double x = left + column * square, y = low + row * square;
      add_rectangle(T, x, y, x + square, y + square,
                    (row + column) % 2 == 0 ? Material::kInk : Material::kPaper, panels);
    }
  }
  if (margin <= 0.0) return;
  add_rectangle(T, left - margin, low - margin, -left + margin, low, Material::kPaper, panels);
  add_rectangle(T, left - margin, -low, -left + margin, -low + margin, Material::kPaper, panels);
  add_rectangle(T, left - margin, low, left, -low, Material::kPaper, panels);
  add_rectangle(T, -left, low, -left + margin, -low, Material::kPaper, panels);
}

void read_marker(YamlMap& map, std::vector<Panel>* panels) {
  const Eigen::Isometry3d T = read_place(map);
  const double diameter = map.number("diameter_m", 0.02, 1.0, 0.12);
  map.text("name", "");
  map.finish();
  // A black ring with a white disc of half its diameter.
  constexpr int kSides = 24;
  const auto rim = [](double radius, int i) {
    const double angle = 2.0 * kPi * i / kSides;
    return Point2{radius * std::cos(angle), radius * std::sin(angle)};
  };
  const double outer = diameter / 2, inner = diameter / 4;
  std::vector<Point2> disc;
  for (int i = 0; i < kSides; ++i) {
    disc.push_back(rim(inner, i));
    add(T, {rim(inner, i), rim(outer, i), rim(outer, i + 1), rim(inner, i + 1)}, Material::kInk, panels);
  }
  add(T, disc, Material::kPaper, panels);
}

}  // namespace knav
