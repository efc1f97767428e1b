#include "localizer_benchmark/image_world.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "brin_benchmark/floor_plan.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/random.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

constexpr int kWallBelow = 100, kFreeFrom = 240;  // grey values
constexpr double kRoom_m = 0.45;                  // clear of walls: where the robot may start
constexpr double kAreaPerPiece_m2 = 15.0;
constexpr double kRobotRadius_m = 0.20;
constexpr double kFurnitureReach_m = 0.75;  // from its middle to its farthest corner

/// Walls where they are drawn, and where free space would end in the unknown.
cv::Mat closed_walls(const cv::Mat& grey) {
  cv::Mat wall = grey < kWallBelow, free = grey >= kFreeFrom, near_free;
  cv::dilate(free, near_free, cv::Mat::ones(3, 3, CV_8U));
  wall |= near_free & (grey < kFreeFrom);
  return wall;
}

/// The middle of the largest open area that does not reach the image's rim.
cv::Point find_start(const cv::Mat& wall, const cv::Mat& grey, double resolution_m, const std::string& file) {
  cv::Mat distance, open, labels, stats, centroids;
  cv::Mat no_wall;
  cv::bitwise_not(wall, no_wall);
  cv::distanceTransform(no_wall, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  open = (distance > kRoom_m / resolution_m) & (grey >= kFreeFrom);
  const int count = cv::connectedComponentsWithStats(open, labels, stats, centroids, 4);
  int best = 0, best_area = 0;
  for (int k = 1; k < count; ++k) {
    const int x = stats.at<int>(k, cv::CC_STAT_LEFT), y = stats.at<int>(k, cv::CC_STAT_TOP);
    const bool rim = x <= 1 || y <= 1 || x + stats.at<int>(k, cv::CC_STAT_WIDTH) >= wall.cols - 1 ||
                     y + stats.at<int>(k, cv::CC_STAT_HEIGHT) >= wall.rows - 1;
    if (rim || stats.at<int>(k, cv::CC_STAT_AREA) <= best_area) continue;
    best = k;
    best_area = stats.at<int>(k, cv::CC_STAT_AREA);
  }
  if (best == 0) throw UserError(file + ": has no free space that is closed all round.");
  const cv::Point2d middle(centroids.at<double>(best, 0), centroids.at<double>(best, 1));
  cv::Point start;
  double nearest = 1e18;
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (labels.at<int>(y, x) != best || distance.at<float>(y, x) < 1.0 / resolution_m * 0.6) continue;
      const double d = std::hypot(x - middle.x, y - middle.y);
      if (d < nearest) {
        nearest = d;
        start = {x, y};
      }
    }
  }
  if (nearest > 1e17) throw UserError(file + ": its largest free space is nowhere 1.2 m wide.");
  return start;
}

/// Every other piece stands free, the rest beside walls, wherever the robot can still reach all it could before.
std::string furniture(const WorldConfig& world, int seed) {
  const FloorPlan plan(world, kRobotRadius_m);
  const std::vector<Point2> open = plan.reachable(0.35);
  std::vector<Point2> must_reach;
  for (std::size_t i = 0; i < open.size(); i += std::max<std::size_t>(1, open.size() / 200)) must_reach.push_back(open[i]);
  const auto wanted = static_cast<int>(static_cast<double>(open.size()) * 0.04 / kAreaPerPiece_m2);  // points 0.2 m apart
  RandomStream random(static_cast<std::uint64_t>(seed), random_stream::kChanges, 0, 3);
  std::vector<Solid> stands;
  std::vector<Point2> at;
  std::string boxes, tables, cylinders;
  int placed = 0;
  for (int attempt = 0; attempt < 30 * wanted && placed < wanted; ++attempt) {
    const Point2 p = open[std::min(open.size() - 1, static_cast<std::size_t>(random.uniform() * static_cast<double>(open.size())))];
    const double yaw_deg = random.uniform(-180.0, 180.0), size = random.uniform(0.0, 1.0);
    const int kind = static_cast<int>(random.uniform() * 3.0);
    const double keep_m = 0.1 + (kind == 2 ? 0.25 : 0.5);
    if (plan.clearance_m(p) < keep_m || std::hypot(p.x_m - world.spawn.x_m, p.y_m - world.spawn.y_m) < 2.0) continue;
    if (std::any_of(at.begin(), at.end(), [&](const Point2& q) { return std::hypot(p.x_m - q.x_m, p.y_m - q.y_m) < 2.0 * kFurnitureReach_m; })) continue;
    const Pose2 pose{p.x_m, p.y_m, yaw_deg * kPi / 180.0};
    const double length = kind == 0 ? 0.4 + 0.5 * size : kind == 1 ? 0.8 + 0.4 * size : 0.3 + 0.2 * size;
    const double width = kind == 0 ? 0.35 + 0.2 * size : kind == 1 ? 0.6 : length;
    stands.push_back(make_box(pose, length, width, 0.0, 0.75, Material::kWood));
    if (!plan.connected(must_reach, stands)) {
      stands.pop_back();
      continue;
    }
    at.push_back(p);
    ++placed;
    const std::string where = fmt::format("at: [{:.2f}, {:.2f}]", p.x_m, p.y_m);
    if (kind == 0) {
      boxes += fmt::format("  - {{{}, yaw_deg: {:.0f}, size: [{:.2f}, {:.2f}, {:.2f}], material: wood}}\n", where, yaw_deg, length, width, 0.6 + 1.2 * size);
    } else if (kind == 1) {
      tables += fmt::format("  - {{{}, yaw_deg: {:.0f}, size: [{:.2f}, {:.2f}], height_m: 0.74, material: wood}}\n", where, yaw_deg, length, width);
    } else {
      cylinders += fmt::format("  - {{{}, radius_m: {:.2f}, height_m: {:.2f}}}\n", where, 0.5 * length, 0.5 + size);
    }
  }
  std::string text;
  if (!boxes.empty()) text += "boxes:\n" + boxes;
  if (!tables.empty()) text += "tables:\n" + tables;
  if (!cylinders.empty()) text += "cylinders:\n" + cylinders;
  return text;
}

}  // namespace

void write_image_world(const std::string& image_file, double resolution_m, const std::string& world_file, int seed) {
  const cv::Mat grey = cv::imread(image_file, cv::IMREAD_GRAYSCALE);
  if (grey.empty()) throw UserError(image_file + ": cannot be read as an image.");
  const cv::Mat wall = closed_walls(grey);
  const cv::Point start = find_start(wall, grey, resolution_m, image_file);
  const std::string closed_file = fs::path(world_file).replace_extension(".png").string();
  cv::Mat picture;
  cv::bitwise_not(wall, picture);
  if (!cv::imwrite(closed_file, picture)) throw UserError(closed_file + ": cannot be written.");
  const std::string text = fmt::format(
      "name: {}\nceiling_m: 3\nspawn: [{:.2f}, {:.2f}, 0]\n"
      "occupancy: {{image: {}, resolution_m: {:g}, origin: [0, 0], height_m: 2.6}}\n",
      fs::path(image_file).stem().string(), (start.x + 0.5) * resolution_m,
      (grey.rows - 1 - start.y + 0.5) * resolution_m, fs::path(closed_file).filename().string(), resolution_m);
  const WorldConfig bare = parse_world(text, image_file, fs::absolute(fs::path(world_file)).parent_path().string());
  write_text_atomically(world_file, text + furniture(bare, seed));
}

}  // namespace knav
