#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

#include "brin_benchmark/clock_pacer.h"

namespace knav {
namespace {

using Wall = std::chrono::steady_clock;

double seconds_since(Wall::time_point start) { return std::chrono::duration<double>(Wall::now() - start).count(); }

TEST(ClockPacer, TimePassesAtItsRateFromTheFirstStepOn) {
  PacingConfig config;
  config.rate = 5.0;
  ClockPacer pacer(config);
  const auto start = Wall::now();
  for (int i = 0; i <= 250; ++i) pacer.wait(100.0 + 0.004 * i, true);  // nobody answers: not asked for
  EXPECT_GT(seconds_since(start), 0.19);
  EXPECT_LT(seconds_since(start), 1.0);
}

TEST(ClockPacer, TimeStopsForAStackThatLagsAndFliesForOneThatFollows) {
  PacingConfig config;
  config.rate = 0.0;
  config.lead_s = 0.1;
  config.patience_s = 30.0;
  ClockPacer pacer(config);
  std::atomic<double> now_s{100.0}, answered_s{0.0};
  std::thread stack([&] {
    while (answered_s < 110.0) {
      const double at_s = now_s;
      answered_s = at_s;
      pacer.heard(ClockPacer::kPose, at_s);
      pacer.heard(ClockPacer::kCommand, at_s);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  });
  const auto start = Wall::now();
  double largest_lead_s = 0.0;
  for (int i = 0; i <= 2500; ++i) {
    now_s = 100.0 + 0.004 * i;
    pacer.wait(now_s, true);
    largest_lead_s = std::max(largest_lead_s, now_s - answered_s);
  }
  now_s = 111.0;
  stack.join();
  EXPECT_LE(largest_lead_s, config.lead_s + 1e-6);
  EXPECT_LT(seconds_since(start), 5.0) << "10 s simulated";
}

TEST(ClockPacer, ASilentStackIsWaitedForOnceAndThenTimePassesAsOnTheWall) {
  PacingConfig config;
  config.rate = 0.0;
  config.patience_s = 0.1;
  ClockPacer pacer(config);
  const auto start = Wall::now();
  for (int i = 0; i <= 50; ++i) pacer.wait(100.0 + 0.004 * i, false);
  EXPECT_GT(seconds_since(start), 0.1 + 0.19);
  EXPECT_LT(seconds_since(start), 2.0);
}

}  // namespace
}  // namespace knav
