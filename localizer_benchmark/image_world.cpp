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

constexpr int kFreeFrom = 240;  // grey value
constexpr double kStreak_m = 0.12;  // half of the width of what is no floor
constexpr double kRoom_m = 0.45;                  // clear of walls: where the robot may start
constexpr double kAreaPerPiece_m2 = 15.0;
constexpr double kRobotRadius_m = 0.20;
constexpr double kFurnitureReach_m = 0.75;  // from its middle to its farthest corner

cv::Mat disc(double radius_px) {
  const int r = std::max(1, static_cast<int>(std::lround(radius_px)));
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * r + 1, 2 * r + 1});
}

/// Without the streaks that a laser drew through windows, and without specks of a pixel.
cv::Mat open_space(const cv::Mat& grey, double resolution_m) {
  cv::Mat free = grey >= kFreeFrom;
  cv::morphologyEx(free, free, cv::MORPH_OPEN, disc(kStreak_m / resolution_m));
  cv::Mat not_free, labels, stats, centroids;
  cv::bitwise_not(free, not_free);
  const int count = cv::connectedComponentsWithStats(not_free, labels, stats, centroids, 8);
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      const int k = labels.at<int>(y, x);
      if (k > 0 && k < count && stats.at<int>(k, cv::CC_STAT_AREA) < 2) free.at<std::uint8_t>(y, x) = 255;
    }
  }
  return free;
}

/// The middle of the largest open area that does not reach the image's rim.
cv::Point find_start(const cv::Mat& free, double resolution_m, const std::string& file) {
  cv::Mat distance, room, labels, stats, centroids;
  cv::distanceTransform(free, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  room = distance > kRoom_m / resolution_m;
  const int count = cv::connectedComponentsWithStats(room, labels, stats, centroids, 4);
  int best = 0, best_area = 0;
  for (int k = 1; k < count; ++k) {
    const int x = stats.at<int>(k, cv::CC_STAT_LEFT), y = stats.at<int>(k, cv::CC_STAT_TOP);
    const double rim_px = kRoom_m / resolution_m + 2.0;
    const bool rim = x <= rim_px || y <= rim_px || x + stats.at<int>(k, cv::CC_STAT_WIDTH) >= free.cols - rim_px ||
                     y + stats.at<int>(k, cv::CC_STAT_HEIGHT) >= free.rows - rim_px;
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
      if (labels.at<int>(y, x) != best || distance.at<float>(y, x) < 0.6 / resolution_m) continue;
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

/// What bounds the space that the start belongs to; nothing else can be seen.
cv::Mat walls_about(const cv::Mat& free, const cv::Point& start) {
  cv::Mat labels, wall;
  cv::connectedComponents(free, labels, 4);
  const cv::Mat inside = labels == labels.at<int>(start);
  cv::dilate(inside, wall, cv::Mat::ones(3, 3, CV_8U));
  wall &= ~inside;
  return wall;
}

/// Every other piece stands free, the rest beside walls, wherever the robot can still reach all it could before.
std::string furniture(const WorldConfig& world, int seed) {
  const FloorPlan plan(world, kRobotRadius_m);
  const std::vector<Point2> open = plan.reachable(0.35);
  std::vector<Point2> must_reach;
  for (std::size_t i = 0; i < open.size(); i += std::max<std::size_t>(1, open.size() / 40)) must_reach.push_back(open[i]);
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
  const cv::Mat free = open_space(grey, resolution_m);
  const cv::Point start = find_start(free, resolution_m, image_file);
  const cv::Mat wall = walls_about(free, start);
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
