#include "kinect_sim/kinect_model.h"

#include <algorithm>
#include <cmath>

#include "core/multiversion.h"
#include "core/pose2.h"
#include "core/random.h"

namespace knav {
namespace {

constexpr float kBandCentre_px = 320.5f;
constexpr float kPhaseAboveZero = 64.0f;  ///< bands; keeps what is rounded by truncation positive
constexpr float kFarthest_m = 40.0f;      ///< nothing comes back from beyond
constexpr float kShadow_codes = 12.0f;  ///< a pixel whose projector column is this much nearer lies in shadow

/// What a row's pixels are read with.
struct RowKernel {
  const float *z_m, *signal, *codes, *offset, *band_position;
  const std::int16_t* grain;
  float bands_far, bands_per_code, band_step;
  float code_metres, farthest_codes, min_range_m, threshold;
  int width_px;
};

/// The disparities that the matcher sees, and the whole codes that the device takes off afterwards.
KNAV_MULTIVERSION
void add_device_error(const RowKernel& kernel, float* seen_codes, std::int32_t* bands) {
  const RowKernel k = kernel;
  for (int u = 0; u < k.width_px; ++u) {
    const float phase = k.band_position[u] * (k.bands_far - k.bands_per_code * k.codes[u]) + kPhaseAboveZero;
    const auto band = static_cast<float>(static_cast<std::int32_t>(phase));
    seen_codes[u] = k.codes[u] - k.offset[u] - k.band_step * (0.5f - (phase - band));
    bands[u] = static_cast<std::int32_t>(k.band_step * band + 0.5f);
  }
}

/// Depth [mm] of what a code stands for; 0 where nothing answers.
KNAV_MULTIVERSION
void read_depth(const RowKernel& kernel, const float* read_codes, std::int32_t* reading_mm) {
  const RowKernel k = kernel;
  for (int u = 0; u < k.width_px; ++u) {
    const float code = read_codes[u] > k.farthest_codes ? read_codes[u] : k.farthest_codes;
    const float mm = 1000.0f * k.code_metres / code;
    const float z_m = k.z_m[u];
    const float fall = 1.0f + z_m * z_m * 0.01f;
    const float grain = 1.0f + 0.2f * NoiseField::kUnit * static_cast<float>(k.grain[u]);
    const bool valid =
        (z_m >= k.min_range_m) & (z_m < kFarthest_m) & (k.signal[u] * grain > k.threshold * fall);
    reading_mm[u] = static_cast<std::int32_t>(valid) * static_cast<std::int32_t>(mm + 0.5f);
  }
}

}  // namespace

const std::vector<std::string>& KinectConfig::preset_names() {
  static const std::vector<std::string> names = {"ideal", "calibrated", "default", "harsh"};
  return names;
}

KinectConfig KinectConfig::preset(const std::string& name) {
  KinectConfig config;
  if (name == "ideal") {
    config.quantize = config.shadow = false;
    config.noise_codes = config.offset_at_10m = config.band_codes = config.dropout_signal = 0.0;
  } else if (name == "calibrated") {
    config.offset_at_10m /= 8.0;
    config.band_codes /= 2.0;
  } else if (name == "harsh") {
    config.offset_at_10m = 0.16;  // more than 10 % at 15-20 m over most of the image
    config.band_codes = 1.5;
    config.noise_codes = 0.70;
    config.dropout_signal = 0.04;
  }
  return config;
}

KinectModel::KinectModel(const KinectConfig& config, const PinholeModel& camera, std::uint64_t seed,
                         std::uint64_t device_seed)
    : config_(config), camera_(camera), seed_(seed), device_seed_(device_seed) {
  if (config.quantize) {
    // Rounding to whole codes adds a twelfth to the variance.
    const double sd = std::sqrt(std::max(0.0, config.noise_codes * config.noise_codes - 1.0 / 12.0));
    matcher_.emplace(seed, camera.width_px, sd, config.slope_noise_px);
  }
  const auto width = static_cast<std::size_t>(camera.width_px);
  // Vertical bands, as the twelve walls in realdata show them: the reading jumps by one code at regular
  // columns, counted from the middle, and creeps back in between. Six jumps across the image at 0.56 m,
  // twelve at 1.4 m on one device, 11 to 14 on the other: their number falls with inverse depth.
  RandomStream bands(device_seed, random_stream::kSimBands, 0, 0);
  bands_far_ = static_cast<float>(config.bands * bands.uniform(0.9, 1.1));
  bands_per_inverse_m_ = static_cast<float>(config.bands * bands.uniform(0.28, 0.315));
  for (int u = 0; u < camera.width_px; ++u) {
    band_position_.push_back((static_cast<float>(u) - kBandCentre_px) / static_cast<float>(camera.width_px));
  }
  codes_.assign(width + 1, 0.0f);
  seen_codes_.assign(width, 0.0f);
  read_codes_.assign(width, 0.0f);
  bands_.assign(width, 0);
  reading_mm_.assign(width, 0);
  lit_codes_.assign(2 * width, 0.0f);
  make_offset(device_seed);
}

void KinectModel::make_offset(std::uint64_t device_seed) {
  // Rings about a point near the centre, a tilt, and a bowl; scaled so that the largest is offset_at_10m.
  RandomStream random(device_seed, random_stream::kSimDevice, 0, 0);
  const double cx = camera_.cx_px + random.uniform(-40, 40), cy = camera_.cy_px + random.uniform(-30, 30);
  const double ring_px = random.uniform(170, 240), phase = random.uniform(0, 2 * kPi);
  const double tilt_x = random.uniform(-0.3, 0.3), tilt_y = random.uniform(-0.3, 0.3),
               bowl = random.uniform(-0.6, 0.6);
  offset_px_.create(camera_.height_px, camera_.width_px, CV_32F);
  double largest = 1e-9;
  for (int v = 0; v < camera_.height_px; ++v) {
    for (int u = 0; u < camera_.width_px; ++u) {
      const double x = u - cx, y = v - cy, r = std::hypot(x, y);
      const double value = std::cos(2 * kPi * r / ring_px + phase) * (0.4 + r / 500.0) + tilt_x * x / 320.0 +
                           tilt_y * y / 240.0 + bowl * (r * r / 160000.0 - 0.3);
      offset_px_.at<float>(v, u) = static_cast<float>(value);
      largest = std::max(largest, std::abs(value));
    }
  }
  // z / (1 - z delta / (f b)) = (1 + e) z at 10 m  <=>  delta = f b e / (10 m (1 + e))
  const double fb = config_.focal_px * config_.baseline_m, e = config_.offset_at_10m;
  offset_px_ *= fb * e / (10.0 * (1.0 + e)) / largest;
  offset_codes_ = offset_px_ * 8.0;
}

void KinectModel::start_frame(std::uint64_t frame_index) {
  RandomStream random(seed_, random_stream::kSimDepth, frame_index, 0x40000000u);
  if (!matcher_) return;
  matcher_->start_frame(&random);
  grain_place_ = NoiseField::any_place(camera_.width_px, &random);
}

void KinectModel::mark_lit(const float* codes) {
  // The projector stands a baseline to the right. A point of disparity d at column u lies in its column u -
  // d; of all points in one projector column only the nearest is lit (the shadow falls to the left of near
  // things).
  const auto columns = static_cast<int>(lit_codes_.size());
  std::fill(lit_codes_.begin(), lit_codes_.end(), 0.0f);
  for (int u = 0; u < camera_.width_px; ++u) {
    const float position = static_cast<float>(u) - codes[u] * 0.125f + static_cast<float>(camera_.width_px);
    const int column = static_cast<int>(position);
    if (column < 0 || column + 1 >= columns) continue;
    float* lit = &lit_codes_[static_cast<std::size_t>(column)];
    lit[0] = std::max(lit[0], codes[u]);
    lit[1] = std::max(lit[1], codes[u]);
  }
}

void KinectModel::sense_row(int row, const TrueRow& in, std::uint16_t* depth_mm) {
  const int width = camera_.width_px;
  const auto fb_codes = static_cast<float>(8.0 * config_.focal_px * config_.baseline_m);
  const auto min_range = static_cast<float>(config_.min_range_m);
  const float* z_m = in.z_m;
  if (!config_.quantize) {
    for (int u = 0; u < width; ++u) {
      const float z = z_m[u];
      depth_mm[u] =
          z >= min_range && z < 65.0f ? static_cast<std::uint16_t>(z * 1000.0f + 0.5f) : std::uint16_t{0};
    }
    return;
  }
  float* codes = codes_.data() + 1;
  for (int u = 0; u < width; ++u) codes[u] = fb_codes / z_m[u];  // 0 at infinity
  codes[-1] = codes[0];
  if (config_.shadow) mark_lit(codes);

  RowKernel kernel = {};
  kernel.z_m = z_m;
  kernel.signal = in.signal;
  kernel.codes = codes;
  kernel.offset = offset_codes_.ptr<float>(row);
  kernel.band_position = band_position_.data();
  kernel.grain = matcher_->block_noise().row(grain_place_, row);
  kernel.bands_far = bands_far_;
  kernel.bands_per_code = bands_per_inverse_m_ / fb_codes;
  kernel.band_step = static_cast<float>(config_.band_codes);
  kernel.code_metres = fb_codes;
  kernel.farthest_codes = static_cast<float>(fb_codes / config_.max_range_m);
  kernel.min_range_m = min_range;
  // Without dropouts any signal is enough.
  kernel.threshold = static_cast<float>(config_.dropout_signal > 0.0 ? config_.dropout_signal : -1.0);
  kernel.width_px = width;
  add_device_error(kernel, seen_codes_.data(), bands_.data());
  // Codes count down to those of infinity. The noise grows where they saturate: anything may come there.
  const auto saturation_codes = static_cast<float>(fb_codes / config_.saturation_m);
  matcher_->match(row, {codes, seen_codes_.data(), bands_.data(), saturation_codes}, read_codes_.data());
  std::int32_t* reading = reading_mm_.data();
  read_depth(kernel, read_codes_.data(), reading);
  if (config_.shadow) {
    for (int u = 0; u < width; ++u) {
      const float position = static_cast<float>(u) - codes[u] * 0.125f + static_cast<float>(width) + 0.5f;
      const int column = std::max(0, static_cast<int>(position));
      if (lit_codes_[static_cast<std::size_t>(column)] > codes[u] + kShadow_codes) reading[u] = 0;
    }
  }
  for (int u = 0; u < width; ++u) depth_mm[u] = static_cast<std::uint16_t>(reading[u]);
}

}  // namespace knav
