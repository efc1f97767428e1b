#include "kinect_sim/noise_field.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr std::size_t kWidth = 1024, kHeight = 512;

double squared(const std::vector<float>& weights) {
  double sum = 0.0;
  for (const float weight : weights) sum += static_cast<double>(weight) * static_cast<double>(weight);
  return sum;
}

}  // namespace

NoiseField::NoiseField(std::uint64_t seed, const std::vector<float>& across, const std::vector<float>& down) {
  std::vector<float> rows(kWidth * kHeight, 0.0f), white(kWidth), sum(kWidth);
  for (std::size_t y = 0; y < kHeight; ++y) {
    RandomStream random(seed, random_stream::kSimDepth, 0, static_cast<std::uint32_t>(y));
    for (float& value : white) value = static_cast<float>(random.normal());
    float* row = &rows[y * kWidth];
    for (std::size_t i = 0; i < across.size(); ++i) {
      for (std::size_t x = 0; x < kWidth; ++x) row[x] += across[i] * white[(x + i) % kWidth];
    }
  }
  const auto scale = static_cast<float>(1.0 / std::sqrt(squared(across) * squared(down))) / kUnit;
  counts_.resize(rows.size());
  for (std::size_t y = 0; y < kHeight; ++y) {
    std::fill(sum.begin(), sum.end(), 0.0f);
    for (std::size_t i = 0; i < down.size(); ++i) {
      const float* row = &rows[(y + i) % kHeight * kWidth];
      for (std::size_t x = 0; x < kWidth; ++x) sum[x] += down[i] * row[x];
    }
    for (std::size_t x = 0; x < kWidth; ++x) {
      counts_[y * kWidth + x] =
          static_cast<std::int16_t>(std::lrint(std::clamp(sum[x] * scale, -32000.0f, 32000.0f)));
    }
  }
}

NoiseField::Place NoiseField::any_place(int width_px, RandomStream* random) {
  Place place;
  place.column = random->bits() % static_cast<std::uint32_t>(kWidth - static_cast<std::size_t>(width_px));
  place.row = random->bits() % static_cast<std::uint32_t>(kHeight);
  return place;
}

const std::int16_t* NoiseField::row(const Place& place, int row_px) const {
  return &counts_[(place.row + static_cast<std::size_t>(row_px)) % kHeight * kWidth + place.column];
}

}  // namespace knav
