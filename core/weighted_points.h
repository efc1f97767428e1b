#pragma once

#include <cstddef>
#include <vector>

namespace knav {

/// Readings as points in the robot's frame, with weights (need not sum to 1).
struct WeightedPoints {
  std::vector<float> x_m, y_m, weight;
  std::size_t size() const { return x_m.size(); }
  void clear() {
    x_m.clear();
    y_m.clear();
    weight.clear();
  }
  void add(float x, float y, float w) {
    x_m.push_back(x);
    y_m.push_back(y);
    weight.push_back(w);
  }
};

}  // namespace knav
