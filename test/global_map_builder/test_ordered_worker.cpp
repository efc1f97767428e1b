// Reading a recording beside mapping it must change neither the order nor what is said of a fault.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

#include "global_map_builder/ordered_worker.h"

namespace knav {
namespace {

TEST(OrderedWorker, CarriesOutAllCallsInTheirOrder) {
  std::vector<int> done;
  OrderedWorker worker(3);
  for (int i = 0; i < 1000; ++i) worker.run([&done, i] { done.push_back(i); });
  worker.finish();
  ASSERT_EQ(done.size(), 1000u);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(done[static_cast<std::size_t>(i)], i);
}

TEST(OrderedWorker, ThrowsWhatACallThrewAndDoesNoMore) {
  std::atomic<int> after{0};
  OrderedWorker worker(2);
  worker.run([] { throw std::runtime_error("the map is full"); });
  EXPECT_THROW(
      {
        for (int i = 0; i < 10; ++i) worker.run([&] { ++after; });
        worker.finish();
      },
      std::runtime_error);
  EXPECT_THROW(worker.finish(), std::runtime_error) << "again, whoever asks";
  EXPECT_EQ(after, 0);
}

TEST(OrderedWorker, DoesNotReadAheadWithoutBound) {
  std::promise<void> gate;
  std::shared_future<void> open = gate.get_future().share();
  std::atomic<int> given{0};
  OrderedWorker worker(4);
  worker.run([open] { open.wait(); });
  std::thread giver([&] {
    for (int i = 0; i < 20; ++i) {
      worker.run([] {});
      ++given;
    }
  });
  while (given < 4) std::this_thread::yield();
  std::this_thread::sleep_for(std::chrono::milliseconds(50));  // in which one without a bound would have given all
  EXPECT_EQ(given, 4);
  gate.set_value();
  giver.join();
  worker.finish();
  EXPECT_EQ(given, 20);
}

TEST(OrderedWorker, DropsWhatHasNotBegunWhenItEnds) {
  std::atomic<int> done{0};
  {
    OrderedWorker worker(10);
    auto waits = std::make_shared<int>(0);  // held by the call that waits, until it is dropped
    worker.run([weak = std::weak_ptr<int>(waits)] {
      const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(10);
      while (!weak.expired() && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    });
    worker.run([&done, waits] { ++done; });
    waits.reset();
  }
  EXPECT_EQ(done, 0);
}

}  // namespace
}  // namespace knav
