#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

namespace knav {

/// Carries out calls on a thread of its own, in the order in which they were given: the next part of a recording is read and decoded while
/// the mapper works on the last, with the same result as without.
class OrderedWorker {
 public:
  /// @param most_waiting  run() waits while so many calls are not begun, to bound memory
  explicit OrderedWorker(std::size_t most_waiting);
  /// What has not begun is dropped.
  ~OrderedWorker();
  OrderedWorker(const OrderedWorker&) = delete;
  OrderedWorker& operator=(const OrderedWorker&) = delete;

  /// Throws what an earlier call threw; none is carried out after that.
  void run(std::function<void()> call);
  /// Waits until all are done. Throws what one threw.
  void finish();

 private:
  void work();

  std::size_t most_waiting_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> waiting_;
  std::exception_ptr thrown_;
  bool busy_ = false, closing_ = false;
  std::thread thread_;
};

}  // namespace knav
