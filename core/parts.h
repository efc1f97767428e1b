#pragma once

#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <cstddef>

namespace knav {

/// Calls work(first, last) for ranges that together are [0, count), on up to `threads` threads. What it does with one element must not
/// depend on the others: then the result is the same bytes with any number.
template <class Work>
void in_parts(std::size_t count, int threads, const Work& work) {
  constexpr std::size_t kPartsAThread = 2, kFewest = 64;  // a wake-up costs as much as some tens of elements
  const std::size_t most = kPartsAThread * static_cast<std::size_t>(threads);
  const std::size_t parts = threads > 1 ? (count / kFewest < most ? count / kFewest : most) : 1;
  if (parts <= 1) {
    work(std::size_t{0}, count);
    return;
  }
  // Isolated: who waits for the rest must not take up a task from outside, which may need what `work` uses of this thread.
  tbb::this_task_arena::isolate([&] {
    tbb::parallel_for(
        std::size_t{0}, parts, [&](std::size_t k) { work(count * k / parts, count * (k + 1) / parts); },
        tbb::simple_partitioner());
  });
}

}  // namespace knav
