// Global planning between random pairs of points of a real floor plan: time, length, safety.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/quantile.h"
#include "core/error.h"
#include "core/progress.h"
#include "core/random.h"
#include "planner_tracker/grid_planner.h"
#include "planner_tracker/theta_star.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

struct Options {
  std::string image, json, picture, tuning;
  std::vector<double> from, to;
  double resolution_m = 0.0456;
  int pairs = 1000;
  int compared = 40;
  bool quick = false;
};

/// CPU time of this thread: others may be using the machine.
double now_ms() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

OccupancyGrid grid_from_image(const Options& options) {
  const cv::Mat image = cv::imread(options.image, cv::IMREAD_GRAYSCALE);
  if (image.empty()) throw UserError(options.image + ": cannot be read as an image.");
  OccupancyGrid grid;
  grid.geometry = {image.cols, image.rows, options.resolution_m, 0.0, 0.0};
  grid.value.resize(grid.geometry.cell_count());
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      grid.value[grid.geometry.index(x, image.rows - 1 - y)] = image.at<std::uint8_t>(y, x) < 128 ? 100 : 0;
    }
  }
  return grid;
}

/// Every sample, a quarter of a cell apart, over a free cell and with the hard clearance less a cell's
/// diagonal.
bool path_is_safe(const MapLayer& layer, const std::vector<Point2>& path, double hard_m) {
  for (std::size_t i = 1; i < path.size(); ++i) {
    const double length = std::hypot(path[i].x_m - path[i - 1].x_m, path[i].y_m - path[i - 1].y_m);
    const int steps = 1 + static_cast<int>(length / (0.25 * layer.geometry.resolution_m));
    for (int k = 0; k <= steps; ++k) {
      const double t = static_cast<double>(k) / steps;
      const double x = path[i - 1].x_m + t * (path[i].x_m - path[i - 1].x_m);
      const double y = path[i - 1].y_m + t * (path[i].y_m - path[i - 1].y_m);
      if (layer.clearance_m(x, y) < hard_m - 1.0 * layer.geometry.resolution_m) return false;
    }
  }
  return true;
}

void draw(const std::string& file, const MapLayer& layer, const std::vector<std::vector<Point2>>& paths) {
  const GridGeometry& g = layer.geometry;
  cv::Mat picture(g.height_cells, g.width_cells, CV_8UC3);
  for (int y = 0; y < g.height_cells; ++y) {
    for (int x = 0; x < g.width_cells; ++x) {
      const double c = layer.clearance_of(layer.squared_at(x, y));
      const auto v = static_cast<std::uint8_t>(
          layer.at(x, y) != CellState::kFree ? 0 : 150 + 105 * std::min(c / 0.7, 1.0));
      picture.at<cv::Vec3b>(g.height_cells - 1 - y, x) = {v, v, v};
    }
  }
  const cv::Scalar colors[] = {{0, 0, 220},   {200, 80, 0},  {0, 150, 0},
                               {180, 0, 180}, {0, 140, 255}, {160, 160, 0}};
  for (std::size_t i = 0; i < paths.size(); ++i) {
    std::vector<cv::Point> line;
    for (const Point2& p : paths[i]) line.push_back({g.cell_x(p.x_m), g.height_cells - 1 - g.cell_y(p.y_m)});
    cv::polylines(picture, line, false, colors[i % 6], 2, cv::LINE_AA);
    for (const auto& corner : line) cv::circle(picture, corner, 4, colors[i % 6], cv::FILLED, cv::LINE_AA);
  }
  if (!cv::imwrite(file, picture)) throw UserError(file + ": cannot be written.");
}

/// One way with different clearances, cut out round it: what they do, to look at.
void draw_tuning(const Options& options) {
  struct Variant {
    const char* name;
    double preferred_m, price;
    cv::Scalar color;
  };
  const PlannerTrackerConfig standard;
  const double preferred_m = standard.clearance.preferred_m, price = standard.clearance.price;
  const Variant variants[] = {{"as it comes", preferred_m, price, {0, 150, 0}},
                              {"price 0", preferred_m, 0.0, {0, 0, 220}},
                              {"price x 4", preferred_m, 4.0 * price, {200, 80, 0}},
                              {"preferred_m x 3", 3.0 * preferred_m, price, {180, 0, 180}}};
  const OccupancyGrid grid = grid_from_image(options);
  const Point2 from{options.from[0], options.from[1]}, to{options.to[0], options.to[1]};
  constexpr int kScale = 3;
  const GridGeometry& g = grid.geometry;
  cv::Mat picture(g.height_cells, g.width_cells, CV_8UC3, cv::Scalar(255, 255, 255));
  for (int y = 0; y < g.height_cells; ++y) {
    for (int x = 0; x < g.width_cells; ++x) {
      if (grid.value[g.index(x, y)] > 50) picture.at<cv::Vec3b>(g.height_cells - 1 - y, x) = {0, 0, 0};
    }
  }
  cv::resize(picture, picture, {}, kScale, kScale, cv::INTER_NEAREST);
  cv::Rect shown;
  int row = 0;
  for (const Variant& variant : variants) {
    PlannerTrackerConfig config;
    config.clearance.preferred_m = variant.preferred_m;
    config.clearance.price = variant.price;
    CombinedMap map(config.preferred_radius_m() + 0.2, 65, 25);
    map.set_global({}, grid, {});
    GridPlanner planner(config);
    planner.set_map(map.global());
    PlanResult result;
    planner.plan(map.global(), from, to, &result);
    if (result.code != PlanCode::kOk) throw UserError("--tuning: there is no way between these points.");
    std::vector<cv::Point> line;
    for (const Point2& p : result.path) {
      line.emplace_back(static_cast<int>(kScale * (p.x_m - g.origin_x_m) / g.resolution_m),
                        static_cast<int>(kScale * (g.height_cells - (p.y_m - g.origin_y_m) / g.resolution_m)));
    }
    cv::polylines(picture, line, false, variant.color, 2, cv::LINE_AA);
    const cv::Rect box = cv::boundingRect(line);
    shown = shown.empty() ? box : (shown | box);
    fmt::print("{}: {:.2f} m\n", variant.name, result.length_m);
  }
  const int rim = static_cast<int>(kScale * 1.2 / g.resolution_m);
  shown = cv::Rect(shown.x - rim, shown.y - rim, shown.width + 2 * rim, shown.height + 2 * rim) & cv::Rect(0, 0, picture.cols, picture.rows);
  cv::Mat cut = picture(shown).clone();
  for (const Variant& variant : variants) {
    cv::putText(cut, variant.name, {8, 22 + 22 * row++}, cv::FONT_HERSHEY_SIMPLEX, 0.6, variant.color, 2, cv::LINE_AA);
  }
  if (!cv::imwrite(options.tuning, cut)) throw UserError(options.tuning + ": cannot be written.");
}

void run(Options options) {
  if (!options.tuning.empty()) {
    if (options.from.size() != 2 || options.to.size() != 2) throw UserError("--tuning: give --from and --to.");
    return draw_tuning(options);
  }
  if (options.quick) {
    options.pairs = std::min(options.pairs, 200);
    options.compared = std::min(options.compared, 10);
  }
  PlannerTrackerConfig config;
  CombinedMap map(config.preferred_radius_m() + 0.2, config.clearance.occupied_threshold,
                  config.clearance.free_threshold);
  const OccupancyGrid grid = grid_from_image(options);
  double start = now_ms();
  map.set_global({}, grid, {});
  const double clearance_ms = now_ms() - start;
  GridPlanner planner(config);
  start = now_ms();
  planner.set_map(map.global());
  const double prepare_ms = now_ms() - start;
  const MapLayer& layer = map.global();

  RandomStream random(1, random_stream::kTest, 0, 0);
  const auto random_point = [&] {
    for (;;) {
      const Point2 p{random.uniform(0.0, grid.geometry.width_cells * grid.geometry.resolution_m),
                     random.uniform(0.0, grid.geometry.height_cells * grid.geometry.resolution_m)};
      if (planner.open(layer, p)) return p;
    }
  };
  std::vector<double> time_ms, unreachable_ms, ratio, length, expanded;
  std::vector<std::vector<Point2>> shown;
  int unsafe = 0;
  PlanResult result;
  Progress progress("planning");
  while (static_cast<int>(time_ms.size()) < options.pairs && unreachable_ms.size() < 20000) {
    stop_if_interrupted();
    const Point2 a = random_point(), b = random_point();
    const double begin = now_ms();
    planner.plan(layer, a, b, &result);
    const double spent_ms = now_ms() - begin;
    if (result.code != PlanCode::kOk) {
      unreachable_ms.push_back(spent_ms);
      continue;
    }
    time_ms.push_back(spent_ms);
    length.push_back(result.length_m);
    expanded.push_back(result.expanded);
    if (!path_is_safe(layer, result.path, config.hard_radius_m())) ++unsafe;
    if (shown.size() < 6) shown.push_back(result.path);
    if (static_cast<int>(ratio.size()) < options.compared) {
      ratio.push_back(result.length_m / theta_star_length_m(layer, config.hard_radius_m(), a, b));
    }
    progress.update(static_cast<double>(time_ms.size()) / options.pairs);
  }
  if (!options.picture.empty()) draw(options.picture, layer, shown);
  const double mean_ratio = ratio.empty() ? std::nan("") : [&] {
    double s = 0;
    for (double r : ratio) s += r;
    return s;
  }() / static_cast<double>(ratio.size());
  fmt::print("clearance {:.0f} ms, parts {:.0f} ms\n", clearance_ms, prepare_ms);
  fmt::print(
      "{} pairs, length median {:.1f} m: median {:.2f} ms, 99 % {:.2f} ms, worst {:.2f} ms; {:.0f} nodes "
      "(median)\n",
      time_ms.size(), quantile(length, 0.5), quantile(time_ms, 0.5), quantile(time_ms, 0.99),
      quantile(time_ms, 1.0), quantile(expanded, 0.5));
  fmt::print("{} unreachable pairs: median {:.1f} ms, worst {:.1f} ms\n", unreachable_ms.size(),
             quantile(unreachable_ms, 0.5), quantile(unreachable_ms, 1.0));
  fmt::print("length / Theta* at the hard clearance, {} pairs: mean {:.4f}, worst {:.4f}; unsafe paths: {}\n",
             ratio.size(), mean_ratio, quantile(ratio, 1.0), unsafe);
  const nlohmann::json json = {{"pairs", time_ms.size()},
                               {"plan_median_ms", quantile(time_ms, 0.5)},
                               {"plan_p99_ms", quantile(time_ms, 0.99)},
                               {"plan_worst_ms", quantile(time_ms, 1.0)},
                               {"unreachable_median_ms", quantile(unreachable_ms, 0.5)},
                               {"length_median_m", quantile(length, 0.5)},
                               {"length_ratio_mean", mean_ratio},
                               {"length_ratio_worst", quantile(ratio, 1.0)},
                               {"unsafe_paths", unsafe},
                               {"clearance_ms", clearance_ms},
                               {"prepare_ms", prepare_ms}};
  write_json(options.json, json.dump(2) + "\n");
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  knav::Options options;
  CLI::App app(
      "Plans between random points of a floor plan (dark = wall) and reports CPU time, length and safety.");
  app.add_option("image", options.image, "floor plan")->required();
  app.add_option("--resolution", options.resolution_m, "m per pixel")->capture_default_str();
  app.add_option("--pairs", options.pairs, "reachable pairs")->capture_default_str();
  app.add_option("--compared", options.compared, "of them compared with Theta* (slow)")
      ->capture_default_str();
  app.add_flag("--quick", options.quick, "200 pairs, 10 compared");
  app.add_option("--picture", options.picture, "PNG with the first six paths");
  app.add_option("--tuning", options.tuning, "instead: PNG of one way planned with different clearances (docs/navigation.md)");
  app.add_option("--from", options.from, "its start: X Y [m] from the image's lower left corner")->expected(2);
  app.add_option("--to", options.to, "its end: X Y [m]")->expected(2);
  app.add_option("--json", options.json,
                 "FILE or -: pairs, plan_{median,p99,worst}_ms, unreachable_median_ms, length_median_m, "
                 "length_ratio_{mean,worst} (to Theta*), unsafe_paths, clearance_ms, prepare_ms");
  return knav::run_command(app, argc, argv, [&] { knav::run(options); });
}
