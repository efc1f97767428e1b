#include "global_map_builder/ordered_worker.h"

#include <utility>

namespace knav {

OrderedWorker::OrderedWorker(std::size_t most_waiting) : most_waiting_(most_waiting), thread_([this] { work(); }) {}

OrderedWorker::~OrderedWorker() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    closing_ = true;
    waiting_.clear();
  }
  changed_.notify_all();
  thread_.join();
}

void OrderedWorker::run(std::function<void()> call) {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [&] { return thrown_ || waiting_.size() < most_waiting_; });
  if (thrown_) std::rethrow_exception(thrown_);
  waiting_.push_back(std::move(call));
  changed_.notify_all();
}

void OrderedWorker::finish() {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [&] { return thrown_ || (waiting_.empty() && !busy_); });
  if (thrown_) std::rethrow_exception(thrown_);
}

void OrderedWorker::work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return closing_ || !waiting_.empty(); });
    if (closing_) return;
    const std::function<void()> call = std::move(waiting_.front());
    waiting_.pop_front();
    busy_ = true;
    lock.unlock();
    std::exception_ptr thrown;
    try {
      call();
    } catch (...) {
      thrown = std::current_exception();
    }
    lock.lock();
    busy_ = false;
    if (thrown) {
      thrown_ = thrown;
      waiting_.clear();
    }
    changed_.notify_all();
    if (thrown) return;
  }
}

}  // namespace knav
