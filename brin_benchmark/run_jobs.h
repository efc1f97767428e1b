#pragma once

#include <cstddef>
#include <functional>

namespace knav {

/// Does items 0 ... count - 1 on several threads, each whole. What is thrown in one of them, `progress` included, stops all.
/// @param work      does an item, telling the fraction done of it
/// @param progress  told the fraction done of all; called from one thread at a time
void run_jobs(std::size_t count, int jobs,
              const std::function<void(std::size_t item, const std::function<void(double)>& progress)>& work,
              const std::function<void(double)>& progress);

}  // namespace knav
