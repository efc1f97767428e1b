#include "core/fast_math.h"

#include <array>
#include <cmath>

#include "core/multiversion.h"
#include "core/pose2.h"

namespace knav {
namespace {

constexpr std::size_t kKnots = 4096;
constexpr std::uint32_t kExactBins = 20;  ///< at either end: 20 / 4096 = 0.5 %, 2.6 standard deviations

/// The quantile of the standard normal distribution by Newton's method on erfc.
double quantile(double p) {
  if (p > 0.5) return -quantile(1.0 - p);
  double z = p < 0.02 ? -std::sqrt(-2.0 * std::log(p)) + 0.5 : 0.0;
  for (int i = 0; i < 60; ++i) {
    const double error = 0.5 * std::erfc(-z / std::sqrt(2.0)) - p;
    const double density = std::exp(-0.5 * z * z) / std::sqrt(2.0 * kPi);
    // Halley's step, which does not overshoot in the tail.
    const double step = error / (density + 0.5 * z * error);
    z -= step;
    if (std::fabs(step) < 1e-13) break;
  }
  return z;
}

std::array<double, kKnots + 1> make_knots() {
  std::array<double, kKnots + 1> knots{};
  for (std::size_t i = 1; i < kKnots; ++i) knots[i] = quantile(static_cast<double>(i) / kKnots);
  return knots;
}

}  // namespace

KNAV_MULTIVERSION
void cos_sin(const double* angle_rad, std::size_t count, double* cosine, double* sine) {
  for (std::size_t i = 0; i < count; ++i) {
    const double turns = rounded(angle_rad[i] * 0.63661977236758134308);  // quarter turns
    const double quarter = turns - 4.0 * rounded(turns * 0.25);           // -2 ... 2
    // pi / 2 in three parts (Cephes), so that nothing is lost.
    const double x = ((angle_rad[i] - turns * 1.57079625129699707031) - turns * 7.54978941586159635335e-8) -
                     turns * 5.39030285815811905290e-15;
    const double z = x * x;
    double s = 1.58962301576546568060e-10;
    s = s * z - 2.50507477628578072866e-8;
    s = s * z + 2.75573136213857245213e-6;
    s = s * z - 1.98412698295895385996e-4;
    s = s * z + 8.33333333332211858878e-3;
    s = s * z - 1.66666666666666307295e-1;
    s = x + x * z * s;
    double c = -1.13585365213876817300e-11;
    c = c * z + 2.08757008419747316778e-9;
    c = c * z - 2.75573141792967388112e-7;
    c = c * z + 2.48015872888517045348e-5;
    c = c * z - 1.38888888888730564116e-3;
    c = c * z + 4.16666666666665929218e-2;
    c = 1.0 - 0.5 * z + z * z * c;
    const double odd = quarter * quarter == 1.0 ? 1.0 : 0.0;
    const double half = quarter * quarter == 4.0 ? -1.0 : 1.0;
    sine[i] = odd != 0.0 ? quarter * c : half * s;
    cosine[i] = odd != 0.0 ? -quarter * s : half * c;
  }
}

double normal_from_bits(std::uint32_t bits) {
  static const std::array<double, kKnots + 1> knots = make_knots();
  const std::uint32_t bin = bits >> 20;
  if (bin < kExactBins || bin >= kKnots - kExactBins) {
    return quantile((static_cast<double>(bits) + 0.5) * 0x1p-32);
  }
  const double t = static_cast<double>(bits & 0xFFFFFu) * 0x1p-20;
  return knots[bin] + t * (knots[bin + 1] - knots[bin]);
}

}  // namespace knav
