#include "brin_benchmark/scoring.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/random.h"

namespace knav {
namespace {

constexpr int kDraws = 2000;

/// Percentile bootstrap of a statistic over runs.
Estimate bootstrap(const std::vector<RunResult>& runs,
                   const std::function<double(const std::vector<const RunResult*>&)>& statistic) {
  std::vector<const RunResult*> all;
  for (const RunResult& run : runs) all.push_back(&run);
  Estimate estimate;
  estimate.mean = statistic(all);
  std::vector<double> draws;
  RandomStream random(1, random_stream::kBootstrap, 0, 0);
  std::vector<const RunResult*> drawn(all.size());
  for (int i = 0; i < kDraws; ++i) {
    for (const RunResult*& run : drawn) {
      const auto k = static_cast<std::size_t>(random.uniform() * static_cast<double>(all.size()));
      run = all[std::min(k, all.size() - 1)];
    }
    const double value = statistic(drawn);
    if (std::isfinite(value)) draws.push_back(value);
  }
  if (draws.empty()) return {estimate.mean, estimate.mean, estimate.mean};
  std::sort(draws.begin(), draws.end());
  const auto at = [&](double share) {
    return draws[static_cast<std::size_t>(share * static_cast<double>(draws.size() - 1))];
  };
  estimate.low = at(0.025);
  estimate.high = at(0.975);
  return estimate;
}

double mean_failures(const std::vector<const RunResult*>& runs) {
  double failures = 0.0;
  for (const RunResult* run : runs) {
    for (const Leg& leg : run->legs) failures += leg.reached ? 0.0 : 1.0;
  }
  return failures / static_cast<double>(runs.size());
}

double mean_speed_mps(const std::vector<const RunResult*>& runs) {
  double time_s = 0.0, distance_m = 0.0;
  for (const RunResult* run : runs) {
    time_s += run->time_s;
    distance_m += run->distance_m;
  }
  return time_s > 0.0 ? distance_m / time_s : 0.0;
}

double mean_error_m(const std::vector<const RunResult*>& runs) {
  double sum = 0.0;
  int reached = 0;
  for (const RunResult* run : runs) {
    for (const Leg& leg : run->legs) {
      if (!leg.reached) continue;
      sum += leg.positioning_error_m;
      ++reached;
    }
  }
  return reached > 0 ? sum / reached : std::nan("");
}

/// Stretches between failures.
void stretches(const std::vector<RunResult>& runs, std::vector<double>* times_s,
               std::vector<double>* distances_m) {
  double time_s = 0.0, distance_m = 0.0;
  const auto end = [&] {
    times_s->push_back(time_s);
    distances_m->push_back(distance_m);
    time_s = distance_m = 0.0;
  };
  for (const RunResult& run : runs) {
    for (const Leg& leg : run.legs) {
      time_s += leg.time_s;
      distance_m += leg.distance_m;
      if (!leg.reached) end();
    }
  }
  if (time_s > 0.0 || times_s->empty()) end();
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

}  // namespace

Score score(const std::vector<RunResult>& runs) {
  Score total;
  if (runs.empty()) return total;
  double squares = 0.0;
  int reached = 0;
  for (const RunResult& run : runs) {
    ++total.runs;
    total.collisions += run.collisions;
    total.walker_contacts += run.walker_contacts;
    total.time_s += run.time_s;
    total.distance_m += run.distance_m;
    for (const Leg& leg : run.legs) {
      ++total.legs;
      if (!leg.reached) {
        ++total.failures;
        continue;
      }
      ++reached;
      total.positioning_error_mean_m += leg.positioning_error_m;
      squares += leg.positioning_error_m * leg.positioning_error_m;
      total.positioning_error_max_m = std::max(total.positioning_error_max_m, leg.positioning_error_m);
    }
  }
  if (reached > 0) {
    const double mean = total.positioning_error_mean_m / reached;
    total.positioning_error_mean_m = mean;
    total.positioning_error_sd_m = std::sqrt(std::max(0.0, squares / reached - mean * mean));
  }
  std::vector<double> times_s, distances_m;
  stretches(runs, &times_s, &distances_m);
  total.mean_time_to_failure_s = mean_of(times_s);
  total.max_time_to_failure_s = *std::max_element(times_s.begin(), times_s.end());
  total.mean_distance_to_failure_m = mean_of(distances_m);
  total.max_distance_to_failure_m = *std::max_element(distances_m.begin(), distances_m.end());
  total.average_speed_mps = total.time_s > 0.0 ? total.distance_m / total.time_s : 0.0;
  total.failures_per_run = bootstrap(runs, mean_failures);
  total.speed_mps = bootstrap(runs, mean_speed_mps);
  total.positioning_error_m = bootstrap(runs, mean_error_m);
  return total;
}

}  // namespace knav
