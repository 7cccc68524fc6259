#include <algorithm>
#include <cfenv>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/core/plugin_calls.hpp>
#include <sidestep/runtime/call_plugin.hpp>

namespace sidestep {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

/// The plugins that threads are in, the outermost first.
std::vector<std::string> on_board() {
  std::vector<std::string> plugins;
  for (const PluginBoard::Thread& thread : plugin_board().threads) {
    for (int i = 0; i < thread.depth; ++i) {
      plugins.emplace_back(thread.calls.at(static_cast<std::size_t>(i)).plugin.view());
    }
  }
  return plugins;
}

TEST(PluginCalls, AreOnTheBoardWhileTheyLast) {
  EXPECT_THAT(on_board(), IsEmpty());
  const auto done = call_plugin("mapper one", []() -> Result<void> {
    EXPECT_THAT(on_board(), ElementsAre("mapper one"));
    return call_stage("robot two", []() -> Result<void> {
      EXPECT_THAT(on_board(), ElementsAre("mapper one", "robot two"));
      std::jthread([] {
        const PluginCall other("cost three");
        EXPECT_EQ(on_board().size(), 3U);
      }).join();
      throw std::runtime_error("away");
    });
  });
  EXPECT_FALSE(done);
  EXPECT_THAT(on_board(), IsEmpty());
}

void nest(int depth) {
  const PluginCall call("optimiser " + std::to_string(depth));
  if (depth < 20) return nest(depth + 1);
  int deepest = 0;
  for (const PluginBoard::Thread& thread : plugin_board().threads) {
    deepest = std::max(deepest, thread.depth.load());
  }
  EXPECT_EQ(deepest, 20);
}

TEST(PluginCalls, WithinEachOtherMayBeMoreThanTheBoardHolds) {
  nest(1);
  EXPECT_THAT(on_board(), IsEmpty());
}

TEST(PluginCalls, OfMoreThreadsThanTheBoardHoldsLeaveNothing) {
  std::atomic<int> inside = 0;
  std::atomic<bool> is_over = false;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 100; ++i) {
    threads.emplace_back([&] {
      const PluginCall call("source of a thread");
      ++inside;
      inside.notify_all();
      is_over.wait(false);
    });
  }
  for (int seen = inside; seen < 100; seen = inside) inside.wait(seen);
  EXPECT_THAT(on_board().size(), testing::AllOf(testing::Ge(60U), testing::Le(64U)));
  is_over = true;
  is_over.notify_all();
  threads.clear();
  EXPECT_THAT(on_board(), IsEmpty());
}

TEST(PluginCalls, KeepTheEndOfLongNames) {
  const PluginCall call("source " + std::string(200, 'x') + " at the end");
  EXPECT_EQ(on_board().front().size(), 95U);
  EXPECT_TRUE(on_board().front().ends_with("x at the end"));
}

TEST(PluginCalls, EndWithTheRoundingThatTheyBeganWith) {
  for (const int rounding : {FE_TOWARDZERO, FE_UPWARD}) {
    {
      const PluginCall call("field that rounds");
      std::fesetround(rounding);
    }
    EXPECT_EQ(std::fegetround(), FE_TONEAREST);
  }
}

}  // namespace
}  // namespace sidestep
