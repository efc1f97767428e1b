#include "planner_tracker/footprint.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace knav {
namespace {

double to_segment_m(const Point2& a, const Point2& b) {
  const double dx = b.x_m - a.x_m, dy = b.y_m - a.y_m, squared = dx * dx + dy * dy;
  const double t = squared > 0.0 ? std::clamp(-(a.x_m * dx + a.y_m * dy) / squared, 0.0, 1.0) : 0.0;
  return std::hypot(a.x_m + t * dx, a.y_m + t * dy);
}

/// Brackets, commas and spaces between the numbers; false if there is anything else.
bool numbers_of(const std::string& text, std::vector<double>* numbers) {
  const char* at = text.c_str();
  while (*at != '\0') {
    if (std::string("[](), \t\n").find(*at) != std::string::npos) {
      ++at;
      continue;
    }
    char* end = nullptr;
    const double value = std::strtod(at, &end);
    if (end == at || !std::isfinite(value)) return false;
    numbers->push_back(value);
    at = end;
  }
  return true;
}

}  // namespace

Footprint Footprint::from_text(const std::string& text, std::string* fault) {
  std::vector<double> numbers;
  if (!numbers_of(text, &numbers) || numbers.size() % 2 != 0 || numbers.size() < 6) {
    *fault = "footprint must be a list of at least three corners, as \"[[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]\".";
    return Footprint();
  }
  std::vector<Point2> corners;
  for (std::size_t i = 0; i < numbers.size(); i += 2) corners.push_back({numbers[i], numbers[i + 1]});
  Footprint out;
  out.inscribed_m_ = std::numeric_limits<double>::infinity();
  double turned_rad = 0.0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Point2 &a = corners[i], &b = corners[(i + 1) % corners.size()];
    out.inscribed_m_ = std::min(out.inscribed_m_, to_segment_m(a, b));
    out.circumscribed_m_ = std::max(out.circumscribed_m_, std::hypot(a.x_m, a.y_m));
    turned_rad += normalize_angle_rad(std::atan2(b.y_m, b.x_m) - std::atan2(a.y_m, a.x_m));
    const int steps = std::max(1, static_cast<int>(std::ceil(std::hypot(b.x_m - a.x_m, b.y_m - a.y_m) / kStep_m)));
    for (int k = 0; k < steps; ++k) {
      const double t = static_cast<double>(k) / steps;
      out.outline_.push_back({a.x_m + t * (b.x_m - a.x_m), a.y_m + t * (b.y_m - a.y_m)});
    }
  }
  // Seen from inside, an outline goes round once.
  if (std::abs(std::abs(turned_rad) - 2.0 * kPi) > 0.1 || out.inscribed_m_ < 0.02) {
    *fault = "footprint must have base_link, [0, 0], inside it, 2 cm from its sides at least.";
    return Footprint();
  }
  if (out.circumscribed_m_ > 3.0) {
    *fault = "footprint reaches farther than 3 m; are its corners in metres?";
    return Footprint();
  }
  return out;
}

}  // namespace knav
