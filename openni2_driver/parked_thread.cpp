#include "openni2_driver/parked_thread.h"

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

namespace knav {
namespace {

class ParkedThread {
 public:
  void start(std::packaged_task<void()> task) {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      task_ = std::move(task);
    }
    wake_.notify_one();
  }
  void live();

 private:
  std::mutex mutex_;
  std::condition_variable wake_;
  std::packaged_task<void()> task_;
};

struct CarPark {
  std::mutex mutex;
  std::vector<ParkedThread*> idle;
};

/// Never destroyed, as its threads never end.
CarPark& car_park() {
  static auto* park = new CarPark;
  return *park;
}

void ParkedThread::live() {
  while (true) {
    std::packaged_task<void()> task;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      wake_.wait(lock, [this] { return task_.valid(); });
      task = std::move(task_);
      task_ = {};
    }
    task();
    CarPark& park = car_park();
    std::lock_guard<std::mutex> lock(park.mutex);
    park.idle.push_back(this);
  }
}

}  // namespace

std::future<void> run_on_parked_thread(std::function<void()> task) {
  std::packaged_task<void()> packaged(std::move(task));
  std::future<void> finished = packaged.get_future();
  ParkedThread* thread = nullptr;
  {
    CarPark& park = car_park();
    std::lock_guard<std::mutex> lock(park.mutex);
    if (!park.idle.empty()) {
      thread = park.idle.back();
      park.idle.pop_back();
    }
  }
  if (thread == nullptr) {
    thread = new ParkedThread;
    std::thread([thread] { thread->live(); }).detach();
  }
  thread->start(std::move(packaged));
  return finished;
}

}  // namespace knav
