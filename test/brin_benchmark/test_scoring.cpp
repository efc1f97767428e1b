#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "brin_benchmark/benchmark_report.h"
#include "brin_benchmark/scoring.h"

namespace knav {
namespace {

Leg reached(double time_s, double distance_m, double error_m) {
  return {"a", true, time_s, distance_m, error_m, ""};
}
Leg failed(double time_s, double distance_m) { return {"b", false, time_s, distance_m, 0.0, "lost"}; }

RunResult run_of(std::vector<Leg> legs) {
  RunResult run;
  run.name = "run";
  for (const Leg& leg : legs) {
    run.time_s += leg.time_s;
    run.distance_m += leg.distance_m;
  }
  run.legs = std::move(legs);
  return run;
}

TEST(Scoring, StretchesBetweenFailuresCrossRunsAndTheLastOneEndsWithThem) {
  // 10 s + 20 s until the first failure; 30 s + 40 s until the second, across the runs; 50 s to the end.
  const Score s = score({run_of({reached(10, 1, 0.1), failed(20, 2), reached(30, 3, 0.3)}),
                         run_of({failed(40, 4), reached(50, 5, 0.2)})});
  EXPECT_EQ(s.failures, 2);
  EXPECT_EQ(s.legs, 5);
  EXPECT_DOUBLE_EQ(s.mean_time_to_failure_s, (30 + 70 + 50) / 3.0);
  EXPECT_DOUBLE_EQ(s.max_time_to_failure_s, 70);
  EXPECT_DOUBLE_EQ(s.mean_distance_to_failure_m, 5.0);
  EXPECT_DOUBLE_EQ(s.average_speed_mps, 0.1);
  EXPECT_NEAR(s.positioning_error_mean_m, 0.2, 1e-12);
  EXPECT_NEAR(s.positioning_error_sd_m, 0.0816497, 1e-6);  // of 0.1, 0.2, 0.3 over n
  EXPECT_DOUBLE_EQ(s.positioning_error_max_m, 0.3);
}

TEST(Scoring, WithoutAFailureTheWholeIsOneStretch) {
  const Score s = score({run_of({reached(10, 4, 0.1)}), run_of({reached(30, 6, 0.1)})});
  EXPECT_EQ(s.failures, 0);
  EXPECT_DOUBLE_EQ(s.max_time_to_failure_s, 40);
  EXPECT_DOUBLE_EQ(s.mean_distance_to_failure_m, 10);
}

TEST(Scoring, IntervalsHoldTheMeanAndHaveNoWidthWhereRunsAgree) {
  std::vector<RunResult> same(12, run_of({reached(10, 4, 0.1)}));
  EXPECT_DOUBLE_EQ(score(same).speed_mps.low, score(same).speed_mps.high);
  same[0].legs.push_back(failed(5, 1));
  const Estimate e = score(same).failures_per_run;
  EXPECT_NEAR(e.mean, 1.0 / 12.0, 1e-12);
  EXPECT_EQ(e.low, 0.0);
  // The failure is drawn 0, 1, 2, 3 times with the probabilities of a binomial of 12 draws at 1/12; 0.975
  // lies at 3.
  EXPECT_NEAR(e.high, 3.0 / 12.0, 1e-12);
}

TEST(Scoring, ARunComesBackFromItsFileAsItWas) {
  RunResult run = run_of({reached(10, 4, 0.125), failed(3, 1)});
  run.collisions = 2;
  run.wall_s = 7.5;
  run.collisions_at.push_back({12.5, 3.0, -4.0});
  run.stage_cost_ms = {{"front end", 2.5}, {"mapper", 4.0}};
  const RunResult again = run_from_json(to_json(run), "run_01.json");
  EXPECT_EQ(to_json(again), to_json(run));
}

TEST(Report, StageCostsAreMeansOverTheRunsThatKnowThemWeighedByTheirTime) {
  RunResult a = run_of({reached(10, 4, 0.125)}), b = a, old = a;
  a.time_s = 10.0;
  a.stage_cost_ms = {{"front end", 2.0}, {"mapper", 4.0}};
  a.frame_cost_ms = 6.0;
  b.time_s = 30.0;
  b.stage_cost_ms = {{"front end", 4.0}, {"mapper", 4.0}};
  b.frame_cost_ms = 8.0;
  const std::string text = report_markdown({old, a, b}, {});
  EXPECT_THAT(text, testing::HasSubstr("| front end | 3.50 ms |"));  // (10 x 2 + 30 x 4) / 40
  EXPECT_THAT(text, testing::HasSubstr("| mapper | 4.00 ms |"));
  EXPECT_THAT(text, testing::HasSubstr("largest mean of a run: 8.0 ms) | 7.5 ms |"));
  EXPECT_THAT(report_markdown({old}, {}), testing::Not(testing::HasSubstr("for a frame")));
}

}  // namespace
}  // namespace knav
