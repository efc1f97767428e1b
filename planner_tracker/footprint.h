#pragma once

#include <string>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// The robot's outline seen from above, in base_link: a disc, or a polygon written as move_base writes it,
/// "[[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]".
class Footprint {
 public:
  /// A disc.
  explicit Footprint(double radius_m = 0.0) : inscribed_m_(radius_m), circumscribed_m_(radius_m) {}
  /// @param fault  receives a sentence if the text is no polygon with base_link in it; then a disc of radius 0 is returned
  static Footprint from_text(const std::string& text, std::string* fault);

  bool is_disc() const { return outline_.empty(); }
  double inscribed_m() const { return inscribed_m_; }          ///< of the largest disc round base_link inside it
  double circumscribed_m() const { return circumscribed_m_; }  ///< of the smallest one round it
  /// Points of a polygon's outline, at most kStep_m apart, corners included.
  const std::vector<Point2>& outline() const { return outline_; }

 private:
  static constexpr double kStep_m = 0.06;

  double inscribed_m_, circumscribed_m_;
  std::vector<Point2> outline_;
};

}  // namespace knav
