#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "record_queue.hpp"

namespace sidestep::testing {
namespace {

constexpr std::chrono::milliseconds kAtOnce{0};

template <class Item>
std::vector<Item> all_of(RecordQueue<Item>& queue) {
  std::vector<Item> all;
  while (auto item = queue.pop(kAtOnce)) all.push_back(std::move(*item));
  return all;
}

TEST(RecordQueue, KeepsTheOrderAcrossClasses) {
  RecordQueue<int> queue(1000);
  const RecordClass classes[] = {RecordClass::kEvent, RecordClass::kDepth, RecordClass::kState,
                                 RecordClass::kMap};
  std::vector<int> pushed;
  for (int i = 0; i < 40; ++i) {
    queue.push(classes[i * i % 4], i, 1);
    pushed.push_back(i);
  }
  EXPECT_EQ(all_of(queue), pushed);
  EXPECT_EQ(queue.dropped(), Dropped{});
}

TEST(RecordQueue, GivesUpOldestDepthThenMapsThenStatesAndNeverEvents) {
  RecordQueue<std::string> queue(100);
  for (int i = 0; i < 4; ++i) queue.push(RecordClass::kDepth, "depth " + std::to_string(i), 20);
  queue.push(RecordClass::kMap, "map 0", 10);
  queue.push(RecordClass::kState, "state 0", 5);
  queue.push(RecordClass::kEvent, "event 0", 5);  // 100: full.
  queue.push(RecordClass::kEvent, "event 1", 1);
  EXPECT_EQ(queue.dropped().of(RecordClass::kDepth), 1);
  queue.push(RecordClass::kDepth, "depth 4", 20);
  EXPECT_EQ(queue.dropped().of(RecordClass::kDepth), 2);
  queue.push(RecordClass::kEvent, "event 2", 75);
  EXPECT_EQ(queue.dropped(), (Dropped{{5, 0, 0}}));
  queue.push(RecordClass::kEvent, "event 3", 10);
  EXPECT_EQ(queue.dropped(), (Dropped{{5, 1, 0}}));
  queue.push(RecordClass::kEvent, "event 4", 10);
  EXPECT_EQ(queue.dropped(), (Dropped{{5, 1, 1}}));
  queue.push(RecordClass::kEvent, "event 5", 500);
  EXPECT_EQ(all_of(queue), (std::vector<std::string>{"event 0", "event 1", "event 2", "event 3",
                                                     "event 4", "event 5"}));
}

TEST(RecordQueue, WhatDoesNotFitAtAllIsGivenUpItself) {
  RecordQueue<int> queue(100);
  queue.push(RecordClass::kEvent, 1, 10);
  queue.push(RecordClass::kDepth, 2, 200);
  EXPECT_EQ(all_of(queue), std::vector<int>{1});
  EXPECT_EQ(queue.dropped(), (Dropped{{1, 0, 0}}));
}

TEST(RecordQueue, EventsLeaveHalfOfTheRoomToTheRest) {
  RecordQueue<int> queue(100);
  queue.push(RecordClass::kDepth, 0, 90);
  EXPECT_TRUE(queue.has_room(50));
  EXPECT_FALSE(queue.has_room(51));
  queue.push(RecordClass::kEvent, 1, 30);
  EXPECT_TRUE(queue.has_room(20));
  EXPECT_FALSE(queue.has_room(21));
  (void)all_of(queue);
  EXPECT_TRUE(queue.has_room(50));
}

TEST(RecordQueue, OnceClosedGivesWhatItHasAndTakesNothing) {
  RecordQueue<int> queue(100);
  queue.push(RecordClass::kState, 1, 1);
  queue.close();
  queue.push(RecordClass::kEvent, 2, 1);
  EXPECT_FALSE(queue.is_done());
  EXPECT_EQ(all_of(queue), std::vector<int>{1});
  EXPECT_TRUE(queue.is_done());
  EXPECT_FALSE(queue.has_room(1));
}

TEST(RecordQueue, ManyMayPushWhileOneTakes) {
  constexpr int kThreads = 3, kEach = 2000;
  RecordQueue<int> queue(1 << 20);
  std::vector<std::vector<int>> taken(kThreads);
  std::jthread taker([&] {
    while (!queue.is_done()) {
      if (const auto item = queue.pop(std::chrono::milliseconds(1000))) {
        taken[static_cast<std::size_t>(*item / kEach)].push_back(*item % kEach);
      }
    }
  });
  {
    std::vector<std::jthread> pushers;
    for (int t = 0; t < kThreads; ++t) {
      pushers.emplace_back([&queue, t] {
        for (int i = 0; i < kEach; ++i) {
          queue.push(i % 2 == 0 ? RecordClass::kState : RecordClass::kEvent, t * kEach + i, 8);
        }
      });
    }
  }
  queue.close();
  taker.join();
  for (const std::vector<int>& one : taken) {
    ASSERT_EQ(one.size(), static_cast<std::size_t>(kEach));
    for (int i = 0; i < kEach; ++i) EXPECT_EQ(one[static_cast<std::size_t>(i)], i);
  }
}

}  // namespace
}  // namespace sidestep::testing
