#include <sidestep/runtime/map_show.hpp>

#include <atomic>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/field/dense_field.hpp>

#include "conformance/test_host.hpp"

namespace sidestep {
namespace {

std::shared_ptr<const DistanceField> some_field() {
  FieldInfo info;
  info.grid = {Eigen::Vector3d::Zero(), 0.1, Eigen::Vector3i(4, 4, 4)};
  return make_dense_field(info, [](const Eigen::Vector3i&) { return 1.0; });
}

/// Wants what it is told to want, and says when it was asked.
class Display final : public MapDisplay {
 public:
  bool wants_map() override {
    ++asked;
    asked.notify_all();
    if (fails) throw std::runtime_error("the screen is broken");
    return wants;
  }
  void show_map(std::shared_ptr<const DistanceField> field) override {
    {
      const std::lock_guard lock(mutex);
      shown = std::move(field);
    }
    ++shows;
    shows.notify_all();
  }
  /// Until it has been asked so much more often; by then whatever it was asked before is done.
  void wait_for_questions(int count) const { wait(asked, asked + count); }
  static void wait(const std::atomic<int>& number, int at_least) {
    for (int now = number; now < at_least; now = number) number.wait(now);
  }

  std::atomic<bool> wants{false};
  std::atomic<bool> fails{false};
  std::atomic<int> asked{0};
  std::atomic<int> shows{0};
  std::mutex mutex;
  std::shared_ptr<const DistanceField> shown;
};

TEST(MapShow, ShowsTheNewestMapToWhoWantsOne) {
  conformance::RecordingLog log;
  SnapshotSlot slot;
  Display display;
  const MapShow show(display, slot, "executor screen", log);
  slot.publish(some_field());
  display.wait_for_questions(2);
  EXPECT_EQ(display.shows, 0) << "nobody looks";
  const auto newest = some_field();
  slot.publish(newest);
  display.wants = true;
  Display::wait(display.shows, 1);
  const std::lock_guard lock(display.mutex);
  EXPECT_EQ(display.shown, newest);
}

TEST(MapShow, ShowsNothingBeforeThereIsAMap) {
  conformance::RecordingLog log;
  const SnapshotSlot slot;
  Display display;
  display.wants = true;
  const MapShow show(display, slot, "executor screen", log);
  display.wait_for_questions(3);
  EXPECT_EQ(display.shows, 0);
}

TEST(MapShow, TellsOfADisplayThatFails) {
  conformance::RecordingLog log;
  SnapshotSlot slot;
  slot.publish(some_field());
  Display display;
  display.fails = true;
  {
    const MapShow show(display, slot, "executor screen", log);
    Display::wait(display.asked, 1);
  }
  EXPECT_EQ(display.shows, 0);
  EXPECT_THAT(log.messages(), ::testing::ElementsAre(
                                  ::testing::AllOf(::testing::HasSubstr("the map is shown no more"),
                                                   ::testing::HasSubstr("executor screen"),
                                                   ::testing::HasSubstr("the screen is broken"))));
}

}  // namespace
}  // namespace sidestep
