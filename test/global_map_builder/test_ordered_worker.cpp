// Reading a recording beside mapping it must change neither the order nor what is said of a fault.
#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <stdexcept>
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
  // One more at most, should the first call not have begun when the count was four.
  EXPECT_LE(given, 5);
  gate.set_value();
  giver.join();
  worker.finish();
  EXPECT_EQ(given, 20);
}

TEST(OrderedWorker, DropsWhatHasNotBegunWhenItEnds) {
  std::promise<void> gate;
  std::shared_future<void> open = gate.get_future().share();
  std::atomic<int> done{0};
  std::thread opener;
  {
    OrderedWorker worker(10);
    worker.run([open] { open.wait(); });
    worker.run([&] { ++done; });
    opener = std::thread([&] { gate.set_value(); });
  }
  opener.join();
  EXPECT_LE(done, 1);
}

}  // namespace
}  // namespace knav
