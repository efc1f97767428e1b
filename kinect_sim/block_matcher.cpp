#include "kinect_sim/block_matcher.h"

#include <algorithm>
#include <cmath>

#include "core/multiversion.h"

namespace knav {
namespace {

constexpr int kBlock_px = 8;
constexpr float kCodesPerPixel = 8.0f;
/// Of the noise's variance, what does not change with the disparity.
constexpr float kSteadyShare = 0.7f;
/// Codes 0 and 3 of a half pixel's four are this much wider than one, 1 and 2 as much narrower.
constexpr float kWider_codes = 0.26f;
/// A surface that falls by so many codes a pixel shows no ripples any more.
constexpr float kRippleless = 1.1f;
constexpr float kSteepest = 1.5f;  ///< codes a pixel; more is an edge
/// Keeps what is rounded by truncation positive; a whole number of pixels.
constexpr std::int32_t kWellAboveZero = 64;

/// Weights of a block's columns or rows. The middle one counts more, for real neighbours are a little less
/// alike than blocks would make them.
std::vector<float> block(int width) {
  std::vector<float> weights(static_cast<std::size_t>(width), 1.0f);
  weights[weights.size() / 2] = 1.7f;
  return weights;
}

/// A row more, of which the outermost two count half: down the columns real noise reaches a little farther.
std::vector<float> column_of_block() {
  std::vector<float> weights = block(kBlock_px + 1);
  weights.front() = weights.back() = 0.5f;
  return weights;
}

/// A speckle turns the block's answer by its distance from the block's middle.
std::vector<float> lever(int width) {
  std::vector<float> weights;
  for (int i = 0; i < width; ++i)
    weights.push_back(static_cast<float>(i) - 0.5f * static_cast<float>(width - 1));
  return weights;
}

// Without comparisons, or the compiler would find no vector code.
float positive_part(float value) { return 0.5f * (value + std::abs(value)); }
float within(float value, float most) { return 0.5f * (std::abs(value + most) - std::abs(value - most)); }

/// sin of a turn in [-0.5, 0.5), to 0.06.
float sine_of(float turn) { return turn * (8.0f - 16.0f * std::abs(turn)); }

}  // namespace

struct BlockMatcher::Kernel {
  Row in;
  const float* above;
  const std::int16_t *steady, *sine, *cosine, *lever_x, *lever_y;
  float steady_codes, changing_codes, lever;
  int width_px;

  KNAV_MULTIVERSION static void run(const Kernel& kernel, float* code);
};

void BlockMatcher::Kernel::run(const Kernel& kernel, float* code) {
  const Kernel k = kernel;
  for (int u = 0; u < k.width_px; ++u) {
    const float surface = k.in.surface[u];
    const float slope_x = within(surface - k.in.surface[u - 1], kSteepest);
    const float slope_y = within(surface - k.above[u], kSteepest);
    const std::int32_t add = k.in.add[u] + kWellAboveZero;
    const float disparity = k.in.seen[u] + static_cast<float>(add);

    float turn = disparity * (1.0f / kCodesPerPixel);
    turn -= static_cast<float>(static_cast<std::int32_t>(turn)) + 0.5f;
    const float quarter_on = turn + (turn < 0.25f ? 0.25f : -0.75f);
    const float block = k.steady_codes * static_cast<float>(k.steady[u]) +
                        k.changing_codes * (sine_of(turn) * static_cast<float>(k.sine[u]) +
                                            sine_of(quarter_on) * static_cast<float>(k.cosine[u]));
    const float levers =
        slope_x * static_cast<float>(k.lever_x[u]) + slope_y * static_cast<float>(k.lever_y[u]);
    const float gain = 1.0f + 2.0f * positive_part(k.in.noisier_below - surface);
    const float matched = disparity + gain * block + k.lever * levers;

    // Two codes at a time: -0.5 to 1.5, of which 0 is the wide one, 1.5 to 3.5, of which it is 3.
    const float slope_squared = slope_x * slope_x + slope_y * slope_y;
    const float ripples = positive_part(1.0f - slope_squared * (1.0f / (kRippleless * kRippleless)));
    const auto pair = static_cast<std::int32_t>(0.5f * matched + 0.25f);
    const float in_pair = matched + 0.5f - static_cast<float>(2 * pair);
    const float first_width = 1.0f + kWider_codes * ripples * static_cast<float>(1 - 2 * (pair & 1));
    code[u] = static_cast<float>(2 * pair + static_cast<std::int32_t>(in_pair >= first_width) - add);
  }
}

BlockMatcher::BlockMatcher(std::uint64_t seed, int width_px, double noise_sd_codes, double lever_px)
    : block_(seed, block(kBlock_px), column_of_block()),
      lever_x_(seed, lever(kBlock_px), column_of_block()),
      lever_y_(seed, block(kBlock_px), lever(kBlock_px)),
      steady_codes_(static_cast<float>(noise_sd_codes) * std::sqrt(kSteadyShare) * NoiseField::kUnit),
      changing_codes_(static_cast<float>(noise_sd_codes) * std::sqrt(1.0f - kSteadyShare) *
                      NoiseField::kUnit),
      lever_(static_cast<float>(lever_px) * NoiseField::kUnit),
      width_px_(width_px),
      above_(static_cast<std::size_t>(width_px)) {}

void BlockMatcher::start_frame(RandomStream* random) {
  for (NoiseField::Place* place : {&steady_, &sine_, &cosine_, &lever_x_place_, &lever_y_place_})
    *place = NoiseField::any_place(width_px_, random);
  last_row_ = -1;
}

void BlockMatcher::match(int row, const Row& in, float* code) {
  // The first row's slope is not known.
  const float* above = last_row_ >= 0 && row == last_row_ + 1 ? above_.data() : in.surface;
  const Kernel kernel = {in,
                         above,
                         block_.row(steady_, row),
                         block_.row(sine_, row),
                         block_.row(cosine_, row),
                         lever_x_.row(lever_x_place_, row),
                         lever_y_.row(lever_y_place_, row),
                         steady_codes_,
                         changing_codes_,
                         lever_,
                         width_px_};
  Kernel::run(kernel, code);
  std::copy_n(in.surface, width_px_, above_.begin());
  last_row_ = row;
}

}  // namespace knav
