#include "kinect_sim/kinect_model.h"

#include <algorithm>
#include <cmath>

#include "core/pose2.h"
#include "core/random.h"

namespace knav {
namespace {

// The noise field: a torus that each frame reads from another place. White noise under a box of 8 x 8 px, as
// the device matches blocks. After quantisation and with the bands that gives what the real walls in realdata
// show, along rows and along columns, at any size of patch: the correlation falls straight to a kink at 8 px.
// What is left beyond it along columns (0.11 on patches of 64 px) are the bands.
constexpr int kFieldWidth = 1024, kFieldHeight = 512;
constexpr int kBoxWidth = 8, kBoxHeight = 8;
constexpr double kFieldUnit = 1.0 / 4096.0;  ///< codes per count

constexpr float kBandCentre_px = 320.5f;
constexpr float kFarthest_m = 40.0f;    ///< nothing comes back from beyond
constexpr float kShadow_codes = 12.0f;  ///< a pixel whose projector column is this much nearer lies in shadow

/// Sums over a running window on a ring.
void box_filter(std::vector<float>& line, std::vector<float>& scratch, int window) {
  const auto n = static_cast<int>(line.size());
  scratch = line;
  double sum = 0.0;
  for (int i = 0; i < window; ++i) sum += scratch[static_cast<std::size_t>(i)];
  for (int i = 0; i < n; ++i) {
    line[static_cast<std::size_t>(i)] = static_cast<float>(sum);
    sum += scratch[static_cast<std::size_t>((i + window) % n)] - scratch[static_cast<std::size_t>(i)];
  }
}

std::vector<std::int16_t> make_field(std::uint64_t seed, int box_width, int box_height, double sd) {
  std::vector<float> field(static_cast<std::size_t>(kFieldWidth) * kFieldHeight), line, scratch;
  for (int y = 0; y < kFieldHeight; ++y) {
    RandomStream random(seed, random_stream::kSimDepth, 0, static_cast<std::uint32_t>(y));
    line.resize(kFieldWidth);
    for (float& value : line) value = static_cast<float>(random.normal());
    box_filter(line, scratch, box_width);
    std::copy(line.begin(), line.end(), field.begin() + static_cast<std::ptrdiff_t>(y) * kFieldWidth);
  }
  line.resize(kFieldHeight);
  for (int x = 0; x < kFieldWidth; ++x) {
    for (int y = 0; y < kFieldHeight; ++y)
      line[static_cast<std::size_t>(y)] =
          field[static_cast<std::size_t>(y) * kFieldWidth + static_cast<std::size_t>(x)];
    box_filter(line, scratch, box_height);
    for (int y = 0; y < kFieldHeight; ++y)
      field[static_cast<std::size_t>(y) * kFieldWidth + static_cast<std::size_t>(x)] =
          line[static_cast<std::size_t>(y)];
  }
  const double scale = sd / std::sqrt(static_cast<double>(box_width) * box_height) / kFieldUnit;
  std::vector<std::int16_t> result(field.size());
  for (std::size_t i = 0; i < field.size(); ++i) {
    result[i] = static_cast<std::int16_t>(std::lrint(std::clamp(field[i] * scale, -32000.0, 32000.0)));
  }
  return result;
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
  const auto width = static_cast<std::size_t>(camera.width_px);
  // Vertical bands, as the twelve walls in realdata show them: the reading jumps by one code at regular
  // columns, counted from the middle, and creeps back in between. Six jumps across the image at 0.56 m,
  // twelve at 1.4 m on one device, 11 to 14 on the other: their number falls with inverse depth.
  RandomStream bands(device_seed, random_stream::kSimBands, 0, 0);
  bands_far_ = static_cast<float>(bands.uniform(14.0, 17.0));
  bands_per_inverse_m_ = static_cast<float>(bands.uniform(4.3, 4.9));
  for (int u = 0; u < camera.width_px; ++u) {
    band_position_.push_back((static_cast<float>(u) - kBandCentre_px) / static_cast<float>(camera.width_px));
  }
  codes_.assign(width, 0.0f);
  reading_.assign(width, 0);
  lit_codes_.assign(2 * width, 0.0f);
  make_offset(device_seed);
  // Rounding to whole codes adds a twelfth to the variance of what was correlated before.
  const double sd = config.quantize
                        ? std::sqrt(std::max(0.0, config.noise_codes * config.noise_codes - 1.0 / 12.0))
                        : config.noise_codes;
  if (!config.quantize) return;
  noise_ = make_field(seed, kBoxWidth, kBoxHeight, 1.0);
  noise_sd_ = static_cast<float>(sd);
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
  noise_column_ = random.bits();
  noise_row_ = random.bits();
  texture_column_ = random.bits();
  texture_row_ = random.bits();
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
  float* codes = codes_.data();
  for (int u = 0; u < width; ++u) codes[u] = fb_codes / z_m[u];  // 0 at infinity
  if (config_.shadow) mark_lit(codes);

  const auto field = [&](std::uint32_t column, std::uint32_t first_row) {
    const std::uint32_t field_row = (first_row + static_cast<std::uint32_t>(row)) % kFieldHeight;
    return &noise_[field_row * kFieldWidth + column % static_cast<std::uint32_t>(kFieldWidth - width)];
  };
  const std::int16_t* noise = field(noise_column_, noise_row_);
  const std::int16_t* texture = field(texture_column_, texture_row_);
  const float* offset = offset_codes_.ptr<float>(row);
  const float* position = band_position_.data();
  const auto step = static_cast<float>(config_.band_codes);
  const float bands_per_code = bands_per_inverse_m_ / fb_codes;
  const float* signal = in.signal;
  const auto unit = static_cast<float>(kFieldUnit);
  const float noise_unit = noise_sd_ * unit;
  const auto saturation_codes = static_cast<float>(fb_codes / config_.saturation_m);
  const auto farthest_codes = static_cast<float>(fb_codes / config_.max_range_m);
  // Without dropouts any signal is enough.
  const auto threshold = static_cast<float>(config_.dropout_signal > 0.0 ? config_.dropout_signal : -1.0);
  std::int32_t* reading = reading_.data();
  for (int u = 0; u < width; ++u) {
    // Codes below the one of infinity. The noise grows where they saturate: anything may come there.
    const float far = std::max(0.0f, saturation_codes - codes[u]);
    const float phase = position[u] * (bands_far_ - bands_per_code * codes[u]) + 64.0f;
    const float band = step * (0.5f - (phase - static_cast<float>(static_cast<std::int32_t>(phase))));
    float code =
        codes[u] - offset[u] - band + (1.0f + 2.0f * far) * noise_unit * static_cast<float>(noise[u]);
    code = std::max(static_cast<float>(static_cast<std::int32_t>(code + 0.5f)), farthest_codes);
    const float mm = 1000.0f * fb_codes / code;
    const float fall = 1.0f + z_m[u] * z_m[u] * 0.01f;
    const float grain = 1.0f + 0.2f * unit * static_cast<float>(texture[u]);
    const bool valid =
        (z_m[u] >= min_range) & (z_m[u] < kFarthest_m) & (signal[u] * grain > threshold * fall);
    reading[u] = valid ? static_cast<std::int32_t>(mm + 0.5f) : 0;
  }
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
