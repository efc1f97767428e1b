#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/fast_math.h"
#include "core/random.h"

namespace knav {
namespace {

// Known answers published with Random123 (kat_vectors, philox4x32 10).
TEST(Philox, GivesThePublishedAnswers) {
  std::uint32_t out[4];
  const std::uint32_t zero_counter[4] = {0, 0, 0, 0}, zero_key[2] = {0, 0};
  philox4x32_10(zero_counter, zero_key, out);
  EXPECT_EQ(out[0], 0x6627e8d5u);
  EXPECT_EQ(out[1], 0xe169c58du);
  EXPECT_EQ(out[2], 0xbc57ac4cu);
  EXPECT_EQ(out[3], 0x9b00dbd8u);
  const std::uint32_t pi_counter[4] = {0x243f6a88u, 0x85a308d3u, 0x13198a2eu, 0x03707344u};
  const std::uint32_t pi_key[2] = {0xa4093822u, 0x299f31d0u};
  philox4x32_10(pi_counter, pi_key, out);
  EXPECT_EQ(out[0], 0xd16cfe09u);
  EXPECT_EQ(out[1], 0x94fdccebu);
  EXPECT_EQ(out[2], 0x5001e420u);
  EXPECT_EQ(out[3], 0x24126ea1u);
}

TEST(RandomStream, DependsOnKeyOnly) {
  RandomStream a(7, 1, 2, 3), b(7, 1, 2, 3), other(7, 1, 2, 4);
  const double first = a.uniform();
  EXPECT_EQ(first, b.uniform());
  EXPECT_NE(first, other.uniform());
}

// 1e5 draws: the mean's sd is 0.0032 and the variance's 0.0045, so 5 sd are 0.016 and 0.022.
TEST(RandomStream, NormalHasUnitMoments) {
  RandomStream random(1, random_stream::kTest, 0, 0);
  double sum = 0, squares = 0;
  const int n = 100000;
  for (int i = 0; i < n; ++i) {
    const double x = random.normal();
    sum += x;
    squares += x * x;
  }
  EXPECT_NEAR(sum / n, 0.0, 0.016);
  EXPECT_NEAR(squares / n, 1.0, 0.023);
}

TEST(FastMath, CosineAndSineAgreeWithTheLibrary) {
  std::vector<double> angle, cosine(4001), sine(4001);
  for (int i = -2000; i <= 2000; ++i) angle.push_back(0.013 * i);
  cos_sin(angle.data(), angle.size(), cosine.data(), sine.data());
  for (std::size_t i = 0; i < angle.size(); ++i) {
    ASSERT_NEAR(cosine[i], std::cos(angle[i]), 1e-11) << angle[i];
    ASSERT_NEAR(sine[i], std::sin(angle[i]), 1e-11) << angle[i];
  }
}

TEST(FastMath, NormalNumbersHaveTheNormalDistribution) {
  // The quantiles of a table of the normal distribution.
  EXPECT_NEAR(normal_from_bits(0x80000000u), 0.0, 1e-9);
  EXPECT_NEAR(normal_from_bits(static_cast<std::uint32_t>(0.841344746 * 4294967296.0)), 1.0, 1e-3);
  EXPECT_NEAR(normal_from_bits(static_cast<std::uint32_t>(0.022750132 * 4294967296.0)), -2.0, 1e-3);
  EXPECT_NEAR(normal_from_bits(static_cast<std::uint32_t>(0.998650102 * 4294967296.0)), 3.0, 1e-6);
  EXPECT_NEAR(normal_from_bits(0), -6.34, 0.02);  // the probability 2^-33
  EXPECT_EQ(normal_from_bits(0), -normal_from_bits(0xFFFFFFFFu));
  double sum = 0.0, square = 0.0, fourth = 0.0;
  constexpr std::uint32_t kCount = 200000;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    double n[3];
    three_normals(3, random_stream::kTest, 1, i, n);
    for (const double z : n) {
      sum += z;
      square += z * z;
      fourth += z * z * z * z;
    }
  }
  // Four standard deviations of the sample's moments.
  constexpr double kNumbers = 3.0 * kCount;
  EXPECT_NEAR(sum / kNumbers, 0.0, 4 / std::sqrt(kNumbers));
  EXPECT_NEAR(square / kNumbers, 1.0, 4 * std::sqrt(2 / kNumbers));
  EXPECT_NEAR(fourth / kNumbers, 3.0, 4 * std::sqrt(96 / kNumbers));
}

}  // namespace
}  // namespace knav
