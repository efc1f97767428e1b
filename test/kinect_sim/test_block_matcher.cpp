#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "kinect_sim/block_matcher.h"

namespace knav {
namespace {

constexpr int kWidth = 640, kHeight = 480;

/// What is read of surface(u, v) [codes], one frame; always from the same places of the noise.
std::vector<float> read(BlockMatcher* matcher, const std::function<float(int, int)>& surface) {
  std::vector<float> image, row(kWidth + 1), code(kWidth);
  const std::vector<std::int32_t> add(kWidth, 0);
  RandomStream random(1, random_stream::kTest, 0, 0);
  matcher->start_frame(&random);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = -1; u < kWidth; ++u) row[static_cast<std::size_t>(u + 1)] = surface(u, v);
    matcher->match(v, {row.data() + 1, row.data() + 1, add.data(), 0.0f}, code.data());
    image.insert(image.end(), code.begin(), code.end());
  }
  return image;
}

/// Variance of what is read less the surface, and its correlations at 4 px; the first row and column left
/// out.
struct Errors {
  double variance = 0.0, along_rows = 0.0, down_columns = 0.0;
};
Errors errors_of(const std::vector<float>& image, const std::function<float(int, int)>& surface) {
  const auto error = [&](int u, int v) {
    return static_cast<double>(image[static_cast<std::size_t>(v * kWidth + u)] - surface(u, v));
  };
  Errors errors;
  double count = 0.0;
  for (int v = 1; v + 4 < kHeight; ++v) {
    for (int u = 1; u + 4 < kWidth; ++u) {
      count += 1.0;
      errors.variance += error(u, v) * error(u, v);
      errors.along_rows += error(u, v) * error(u + 4, v);
      errors.down_columns += error(u, v) * error(u, v + 4);
    }
  }
  errors.along_rows /= errors.variance;
  errors.down_columns /= errors.variance;
  errors.variance /= count;
  return errors;
}

TEST(BlockMatcher, TwoCodesOfAHalfPixelAreWiderThanTheOtherTwo) {
  // A hundredth of a code a pixel, 6.4 codes in all: every code is seen a hundred times its width.
  BlockMatcher matcher(1, kWidth, 0.0, 0.0);
  const std::vector<float> image =
      read(&matcher, [](int u, int) { return 158.0f + 0.01f * static_cast<float>(u); });
  std::array<int, 4> times = {};
  for (std::size_t u = 0; u < kWidth; ++u) {
    const auto code = static_cast<int>(image[u]);
    if (code >= 160 && code < 164) ++times[static_cast<std::size_t>(code % 4)];
  }
  const std::array<int, 4> expected = {126, 74, 74, 126};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(times[i], expected[i], 1) << i;
}

TEST(BlockMatcher, ASteepSurfaceShowsEqualCodes) {
  // A block of 8 px sees a whole pixel of disparities: nothing is left of where in a half pixel each lies.
  BlockMatcher matcher(1, kWidth, 0.0, 0.0);
  const auto surface = [](int u, int v) {
    return 900.3f - 1.13f * static_cast<float>(v) + 0.01f * static_cast<float>(u);
  };
  const std::vector<float> image = read(&matcher, surface);
  for (int v = 1; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      EXPECT_LE(std::abs(image[static_cast<std::size_t>(v * kWidth + u)] - surface(u, v)), 0.501f)
          << u << " " << v;
    }
  }
}

TEST(BlockMatcher, ASlantedSurfacesNoiseIsItsSlopeTimesTheLever) {
  // At 0.9 codes a row codes are almost equally wide, so that rounding adds a twelfth: 0.42 px x 0.9 has
  // variance 0.143. The field holds some 4000 blocks: that is known to 2 % sd; tolerated are four times it.
  BlockMatcher matcher(1, kWidth, 0.0, 0.42);
  for (const bool down : {false, true}) {
    const auto surface = [down](int u, int v) { return 100.0f + 0.9f * static_cast<float>(down ? v : u); };
    const Errors errors = errors_of(read(&matcher, surface), surface);
    EXPECT_NEAR(errors.variance - 1.0 / 12.0, 0.143, 0.012) << down;
  }
  // Square on there is none.
  const auto wall = [](int, int) { return 200.0f; };
  EXPECT_EQ(errors_of(read(&matcher, wall), wall).variance, 0.0);
}

TEST(BlockMatcher, NoiseIsBackAfterAPixelOfDisparityAndOtherAfterAHalf) {
  // 0.3 of the variance turns its sign after half a pixel: differences of variance 4 x 0.3 x 4 codes, and a
  // sixth from rounding twice. The sine's stand-in has 7 % more variance than a sine; 4000 blocks: 2 % sd.
  BlockMatcher matcher(1, kWidth, 2.0, 0.0);
  const std::vector<float> here = read(&matcher, [](int, int) { return 200.0f; }),
                           half_on = read(&matcher, [](int, int) { return 204.0f; }),
                           one_on = read(&matcher, [](int, int) { return 208.0f; });
  double squares = 0.0;
  for (std::size_t i = 0; i < here.size(); ++i) {
    EXPECT_EQ(one_on[i], here[i] + 8.0f);
    const double difference = static_cast<double>(half_on[i] - here[i]) - 4.0;
    squares += difference * difference / static_cast<double>(here.size());
  }
  EXPECT_NEAR(squares, 4.0 * 0.3 * 4.0 + 1.0 / 6.0, 0.12 * 4.8);
}

TEST(BlockMatcher, NoiseEndsSoonerAlongTheSlopeThanAcross) {
  // Real surfaces of 0.3-0.45 codes a pixel (docs/simulator.md): 0.04 and 0.01 along the slope at 4 px, 0.27
  // across, of patches of 32 px, which take some 0.05-0.1 away that is still here.
  BlockMatcher matcher(1, kWidth, 0.38, 0.42);
  for (const bool down : {false, true}) {
    const auto surface = [down](int u, int v) { return 100.3f + 0.39f * static_cast<float>(down ? v : u); };
    const Errors errors = errors_of(read(&matcher, surface), surface);
    const double along = down ? errors.down_columns : errors.along_rows;
    const double across = down ? errors.along_rows : errors.down_columns;
    EXPECT_LT(along, 0.15) << down;
    EXPECT_GT(across, 0.27) << down;
  }
}

}  // namespace
}  // namespace knav
