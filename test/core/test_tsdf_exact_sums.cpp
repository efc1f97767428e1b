// The property that makes the sliding window trustworthy: whatever is added, removed, scrolled and contradicted,
// a cell holds exactly the sum of what the rules say, to the bit.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "core/random.h"
#include "core/tsdf_grid.h"
#include "test/core/tsdf_observations.h"

namespace knav {
namespace {

TEST(TsdfGrid, PlainAndVectorCodeAndSeveralThreadsGiveTheSameBytes) {
  TsdfConfig config;  // the defaults: weights that fall off behind surfaces
  config.every_row_to_m = 1.5;  // farther rows take turns
  TsdfGrid plain(config, 3.2, false), vectors(config, 3.2, true);
  config.threads = 3;
  TsdfGrid threads(config, 3.2, true);
  RandomStream random(11, random_stream::kTest, 3, 0);
  std::vector<TsdfObservation> held;
  double x = 0.0, y = 0.0;
  for (std::uint32_t sequence = 1; sequence <= 600; ++sequence) {
    x = std::fmod(x + random.uniform(-0.15, 0.2), 4.0);
    y = std::fmod(y + random.uniform(-0.15, 0.2), 4.0);
    const bool wild = random.uniform() < 0.3;
    const double wall_m = random.uniform(0.5, 5.0);
    DepthProfile profile = profile_of(std::vector<float>(57), 45.0);
    for (std::size_t i = 0; i < 57; ++i) {
      profile.z_m[i] = random.uniform() < 0.05 ? kNaN : static_cast<float>(wild ? random.uniform(0.3, 5.0) : wall_m);
      profile.free_from_m[i] = random.uniform() < 0.1 ? kNaN : 0.8f;
      profile.free_to_m[i] = static_cast<float>(wall_m);
      profile.height_class[i] = random.uniform() < 0.2 ? HeightClass::kLow : HeightClass::kMiddle;
    }
    TsdfObservation o;
    observation_from(profile, limits_of(config), &o);
    o.sequence = sequence;
    o.T_map_sensor = {x, y, random.uniform(-kPi, kPi)};
    for (TsdfGrid* grid : {&plain, &vectors, &threads}) {
      grid->scroll_to(x, y, sequence);
      grid->add(o);
    }
    held.push_back(o);
    if (held.size() > 20) {
      const auto victim = held.begin() + static_cast<std::ptrdiff_t>(random.uniform() * 20);
      for (TsdfGrid* grid : {&plain, &vectors, &threads}) grid->remove(*victim);
      held.erase(victim);
    }
  }
  EXPECT_GT(plain.cells_reset_by_contradiction(), 100u);
  EXPECT_EQ(plain.cells_reset_by_contradiction(), vectors.cells_reset_by_contradiction());
  EXPECT_EQ(plain.cells_reset_by_contradiction(), threads.cells_reset_by_contradiction());
  int different = 0, standing = 0;
  for (int iy = plain.first_y(); iy < plain.first_y() + plain.size_cells() - 1; ++iy) {
    for (int ix = plain.first_x(); ix < plain.first_x() + plain.size_cells() - 1; ++ix) {
      for (const TsdfGrid* other : {&vectors, &threads}) {
        different += plain.weighted_sum_units(ix, iy) != other->weighted_sum_units(ix, iy) ||
                             plain.weight_units(ix, iy) != other->weight_units(ix, iy) ||
                             plain.standing_weight_units(ix, iy) != other->standing_weight_units(ix, iy) ||
                             plain.reset_sequence(ix, iy) != other->reset_sequence(ix, iy) ||
                             plain.last_seen_s(ix, iy) != other->last_seen_s(ix, iy) ||
                             plain.value(ix, iy) != other->value(ix, iy) ||
                             plain.quads()[plain.quad_index(ix, iy)] != other->quads()[other->quad_index(ix, iy)]
                         ? 1
                         : 0;
      }
      standing += plain.standing_weight_units(ix, iy) > 0 ? 1 : 0;
      // The quad is its four cells.
      const std::uint32_t quad = plain.quads()[plain.quad_index(ix, iy)];
      ASSERT_EQ(static_cast<std::int8_t>(quad & 255u), plain.value(ix, iy));
      ASSERT_EQ(static_cast<std::int8_t>(quad >> 8 & 255u), plain.value(ix + 1, iy));
      ASSERT_EQ(static_cast<std::int8_t>(quad >> 16 & 255u), plain.value(ix, iy + 1));
      ASSERT_EQ(static_cast<std::int8_t>(quad >> 24), plain.value(ix + 1, iy + 1));
    }
  }
  EXPECT_EQ(different, 0);
  EXPECT_GT(standing, 0);
  for (const TsdfObservation& o : held) plain.remove(o);
  for (int iy = plain.first_y(); iy < plain.first_y() + plain.size_cells(); ++iy) {
    for (int ix = plain.first_x(); ix < plain.first_x() + plain.size_cells(); ++ix) {
      ASSERT_EQ(plain.weight_units(ix, iy), 0);
      ASSERT_EQ(plain.standing_weight_units(ix, iy), 0);
    }
  }
}

/// An observation of which the part from `near_to_m` on may have left by itself.
struct Held {
  TsdfObservation observation;
  float near_to_m = std::numeric_limits<float>::infinity();
  /// Of what it says of a cell; negative: that part has left. Worked out in double: 0 within its rounding.
  double margin_m(double x_m, double y_m) const {
    const double off_m = near_to_m - std::hypot(x_m - observation.T_map_sensor.x_m, y_m - observation.T_map_sensor.y_m);
    return std::abs(off_m) < 1e-4 ? 0.0 : off_m;
  }
};

/// What the rules say of one cell, kept beside the grid: all held observations not older than its reset.
void expect_equals_fresh_sum(const TsdfGrid& grid, const TsdfConfig& config, const std::map<std::uint32_t, Held>& held) {
  // A grid of its own for each observation gives that observation's part of every cell.
  const int n = grid.size_cells();
  std::vector<std::int32_t> sum(static_cast<std::size_t>(n) * static_cast<std::size_t>(n)),
      weight(sum.size());
  TsdfConfig no_reset = config;
  TsdfGrid single(no_reset, 0.5 * n * config.resolution_m);
  std::vector<std::uint8_t> unsure(sum.size());  // whether a cell is near or far, in float
  for (const auto& [sequence, one] : held) {
    single.clear();
    single.scroll_to(grid.center_m(grid.first_x() + n / 2), grid.center_m(grid.first_y() + n / 2), 1);
    single.add(one.observation);
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        const int ix = grid.first_x() + x, iy = grid.first_y() + y;
        if (!single.contains(ix, iy) || grid.reset_sequence(ix, iy) > sequence) continue;
        const auto i = static_cast<std::size_t>(y * n + x);
        const double margin_m = one.margin_m(grid.center_m(ix), grid.center_m(iy));
        unsure[i] |= margin_m == 0.0 ? 1 : 0;
        if (margin_m < 0.0) continue;
        sum[i] += single.weighted_sum_units(ix, iy);
        weight[i] += single.weight_units(ix, iy);
      }
    }
  }
  int wrong = 0, known = 0;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const int ix = grid.first_x() + x, iy = grid.first_y() + y;
      const auto i = static_cast<std::size_t>(y * n + x);
      if (!single.contains(ix, iy) || unsure[i] != 0) continue;
      wrong += grid.weighted_sum_units(ix, iy) != sum[i] || grid.weight_units(ix, iy) != weight[i] ? 1 : 0;
      known += weight[i] > 0 ? 1 : 0;
    }
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(known, 0);
}

/// Sensor is a profile (or a scan), vector code is used.
class AddRemoveProperty : public ::testing::TestWithParam<std::tuple<bool, bool>> {};

TEST_P(AddRemoveProperty, ExactWhateverTheOrderWithScrollingAndResets) {
  const bool pinhole = std::get<0>(GetParam());
  TsdfConfig config = fixed_truncation(0.3);
  config.every_row_to_m = 1.5;  // farther rows take turns
  TsdfGrid grid(config, 3.2, std::get<1>(GetParam()));  // 128 x 128 cells: the observations reach out of it
  std::map<std::uint32_t, Held> held;
  int far_parts = 0;
  RandomStream random(7, random_stream::kTest, pinhole ? 1 : 2, 0);
  std::uint32_t sequence = 0;
  double x = 0.0, y = 0.0;
  for (int round = 0; round < 1500; ++round) {
    x = std::fmod(x + random.uniform(-0.15, 0.2), 4.0);
    y = std::fmod(y + random.uniform(-0.15, 0.2), 4.0);
    grid.scroll_to(x, y, sequence + 1);
    TsdfObservation o;
    if (pinhole) {
      DepthProfile profile = profile_of(std::vector<float>(48), 45.0);
      const bool wild = random.uniform() < 0.5;
      const double wall_m = random.uniform(0.5, 5.0);
      for (std::size_t i = 0; i < 48; ++i) {
        profile.z_m[i] = wild && random.uniform() < 0.1
                             ? kNaN
                             : static_cast<float>(wild ? random.uniform(0.05, 5.0) : wall_m);
        profile.free_from_m[i] = 0.5f;
        profile.free_to_m[i] = static_cast<float>(wild ? random.uniform(0.3, 5.0) : wall_m);
      }
      observation_from(profile, limits_of(config), &o);
    } else {
      RangeScan scan;
      scan.angle_min_rad = random.uniform(-3.0, 0.0);
      scan.angle_increment_rad = 0.05;
      scan.range_max_m = 6.0;
      for (int i = 0; i < 70; ++i) scan.range_m.push_back(static_cast<float>(random.uniform(0.05, 5.0)));
      observation_from(scan, limits_of(config), &o);
    }
    o.sequence = ++sequence;
    o.T_map_sensor = {x + random.uniform(-0.5, 0.5), y, random.uniform(-kPi, kPi)};
    grid.add(o);
    held[o.sequence].observation = o;
    const auto any = [&] {
      auto one = held.begin();
      std::advance(one, static_cast<std::ptrdiff_t>(random.uniform() * static_cast<double>(held.size())));
      return one;
    };
    if (const auto one = any(); random.uniform() < 0.2 && std::isinf(one->second.near_to_m)) {
      one->second.near_to_m = static_cast<float>(random.uniform(0.3, 4.0));
      grid.remove(one->second.observation, {one->second.near_to_m});
      ++far_parts;
    }
    while (held.size() > 12 || (held.size() > 1 && random.uniform() < 0.2)) {
      const auto victim = any();
      grid.remove(victim->second.observation, {0.0f, victim->second.near_to_m});
      held.erase(victim);
    }
    if (round % 150 == 149) expect_equals_fresh_sum(grid, config, held);
  }
  EXPECT_GT(grid.cells_reset_by_contradiction(), 100u);
  EXPECT_GT(far_parts, 100);
  for (const auto& entry : held) grid.remove(entry.second.observation, {0.0f, entry.second.near_to_m});
  int left = 0;
  for (int iy = grid.first_y(); iy < grid.first_y() + grid.size_cells(); ++iy) {
    for (int ix = grid.first_x(); ix < grid.first_x() + grid.size_cells(); ++ix) {
      left += grid.weight_units(ix, iy) != 0 || grid.weighted_sum_units(ix, iy) != 0 || grid.known(ix, iy) ||
                      grid.value(ix, iy) != TsdfGrid::kUnknown
                  ? 1
                  : 0;
    }
  }
  EXPECT_EQ(left, 0);
}
INSTANTIATE_TEST_SUITE_P(Sensors, AddRemoveProperty, ::testing::Combine(::testing::Bool(), ::testing::Bool()),
                         [](const auto& kind) {
                           return std::string(std::get<0>(kind.param) ? "Profile" : "Scan") +
                                  (std::get<1>(kind.param) ? "Vectors" : "Plain");
                         });

}  // namespace
}  // namespace knav
