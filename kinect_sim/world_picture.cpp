#include "kinect_sim/world_picture.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace knav {

WorldPicture::WorldPicture(const WorldConfig& world, double pixels_per_m)
    : world_(world), scale_(pixels_per_m) {
  const FloorRect& b = world.bounds;
  const int width = static_cast<int>(std::ceil((b.max_x_m - b.min_x_m) * scale_)) + 1;
  const int height = static_cast<int>(std::ceil((b.max_y_m - b.min_y_m) * scale_)) + 1;
  image_ = cv::Mat(height, width, CV_8UC3, cv::Scalar(255, 255, 255));
}

cv::Point WorldPicture::pixel(const Point2& p) const {
  return {static_cast<int>(std::lround((p.x_m - world_.bounds.min_x_m) * scale_)),
          static_cast<int>(std::lround((world_.bounds.max_y_m - p.y_m) * scale_))};
}

void WorldPicture::fill(const Solid& solid, const cv::Scalar& bgr) {
  std::vector<cv::Point> corners;
  for (const Point2& corner : solid.corners) corners.push_back(pixel(corner));
  cv::fillConvexPoly(image_, corners, bgr, cv::LINE_AA);
}

void WorldPicture::draw_world() {
  for (const FloorRect& s : world_.stairs) {
    cv::rectangle(image_, pixel({s.min_x_m, s.min_y_m}), pixel({s.max_x_m, s.max_y_m}),
                  cv::Scalar(200, 160, 220), -1);
  }
  for (const FloorRect& s : world_.sun_patches) {
    cv::rectangle(image_, pixel({s.min_x_m, s.min_y_m}), pixel({s.max_x_m, s.max_y_m}),
                  cv::Scalar(150, 240, 255), -1);
  }
  for (const Solid& solid : solids_at(world_, 0.0)) {
    if (solid.top_m <= 0.0) continue;
    cv::Scalar colour(60, 60, 60);
    if (solid.material == Material::kGlass) {
      colour = cv::Scalar(230, 200, 120);
    } else if (solid.bottom_m > 1.5) {
      colour = cv::Scalar(220, 220, 220);  // lintels, signs
    } else if (solid.bottom_m > 0.3) {
      colour = cv::Scalar(150, 190, 220);  // table tops
    } else if (solid.top_m < 0.25) {
      colour = cv::Scalar(80, 80, 230);  // low things
    } else if (solid.material != Material::kWall) {
      colour = cv::Scalar(80, 130, 170);
    }
    fill(solid, colour);
  }
  for (const PersonConfig& person : world_.people) {
    std::vector<Point2> path;
    for (const auto& waypoint : person.path) path.push_back(waypoint.at);
    draw_path(path, cv::Scalar(60, 140, 255));
    draw_point(path.front(), cv::Scalar(0, 100, 255), static_cast<int>(person.radius_m * scale_));
  }
  const auto label = [&](const Pose2& pose, const std::string& text) {
    draw_point({pose.x_m, pose.y_m}, cv::Scalar(200, 60, 30), 4);
    const Point2 tip = pose * Point2{0.5, 0.0};
    cv::line(image_, pixel({pose.x_m, pose.y_m}), pixel(tip), cv::Scalar(200, 60, 30), 2, cv::LINE_AA);
    cv::putText(image_, text, pixel({pose.x_m + 0.1, pose.y_m + 0.15}), cv::FONT_HERSHEY_SIMPLEX, 0.45,
                cv::Scalar(200, 60, 30), 1, cv::LINE_AA);
  };
  for (const auto& [name, pose] : world_.places) label(pose, name);
  label(world_.spawn, "start");
}

void WorldPicture::draw_slice(double low_m, double high_m) {
  for (const Solid& solid : solids_at(world_, 0.0)) {
    if (solid.material == Material::kGlass || solid.top_m <= low_m || solid.bottom_m >= high_m) continue;
    fill(solid, cv::Scalar(200, 200, 200));
  }
}

void WorldPicture::draw_point(const Point2& p, const cv::Scalar& bgr, int radius_px) {
  cv::circle(image_, pixel(p), radius_px, bgr, -1, cv::LINE_AA);
}

void WorldPicture::draw_path(const std::vector<Point2>& path, const cv::Scalar& bgr) {
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    cv::line(image_, pixel(path[i]), pixel(path[i + 1]), bgr, 1, cv::LINE_AA);
  }
}

cv::Mat depth_picture(const cv::Mat& depth_mm, double far_m) {
  cv::Mat grey, colours;
  depth_mm.convertTo(grey, CV_8U, -255.0 / (1000.0 * far_m), 255.0);
  cv::applyColorMap(grey, colours, cv::COLORMAP_JET);
  colours.setTo(cv::Scalar(0, 0, 0), depth_mm == 0);
  return colours;
}

}  // namespace knav
