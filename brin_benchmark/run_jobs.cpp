#include "brin_benchmark/run_jobs.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace knav {

void run_jobs(std::size_t count, int jobs,
              const std::function<void(std::size_t item, const std::function<void(double)>& progress)>& work,
              const std::function<void(double)>& progress) {
  std::vector<double> done(count, 0.0);
  std::mutex mutex;
  std::exception_ptr fault;
  std::atomic<std::size_t> next{0};
  const auto report = [&](std::size_t k, double fraction) {
    const std::lock_guard<std::mutex> lock(mutex);
    if (fault) std::rethrow_exception(fault);
    done[k] = fraction;
    double sum = 0.0;
    for (const double d : done) sum += d;
    progress(sum / static_cast<double>(count));
  };
  const auto one_after_the_other = [&] {
    try {
      for (std::size_t k = next++; k < count; k = next++) {
        work(k, [&](double fraction) { report(k, fraction); });
      }
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex);
      if (!fault) fault = std::current_exception();
    }
  };
  std::vector<std::thread> others;
  const int threads = std::clamp(jobs, 1, std::max(1, static_cast<int>(count)));
  for (int i = 1; i < threads; ++i) others.emplace_back(one_after_the_other);
  one_after_the_other();
  for (std::thread& thread : others) thread.join();
  if (fault) std::rethrow_exception(fault);
}

}  // namespace knav
