#include <atomic>
#include <chrono>
#include <thread>

#include <gtest/gtest.h>

#include <sidestep/runtime/snapshot_slot.hpp>

namespace sidestep {
namespace {

class NumberedField final : public DistanceField {
 public:
  explicit NumberedField(std::int64_t number) : DistanceField({.sequence = number}) {}
  void query(std::span<const Eigen::Vector3d>, std::span<double>, std::span<Eigen::Vector3d>,
             std::span<FieldStatus>) const noexcept override {}
};

TEST(SnapshotSlot, ReadersSeeWholeFieldsInOrder) {
  SnapshotSlot slot;
  EXPECT_EQ(slot.pin(), nullptr);
  std::atomic<bool> done = false;
  std::atomic<bool> in_order = true;
  std::thread reader([&] {
    std::int64_t newest = 0;
    while (!done) {
      const auto field = slot.pin();
      if (field == nullptr) continue;
      if (field->info().sequence < newest) in_order = false;
      newest = field->info().sequence;
    }
  });
  for (std::int64_t i = 1; i <= 20000; ++i) slot.publish(std::make_shared<NumberedField>(i));
  done = true;
  reader.join();
  EXPECT_TRUE(in_order);
  EXPECT_EQ(slot.pin()->info().sequence, 20000);
}

TEST(SnapshotSlot, APinnedFieldOutlivesItsSuccessors) {
  SnapshotSlot slot;
  slot.publish(std::make_shared<NumberedField>(1));
  const auto pinned = slot.pin();
  slot.publish(std::make_shared<NumberedField>(2));
  EXPECT_EQ(pinned->info().sequence, 1);
  EXPECT_EQ(pinned.use_count(), 1);
}

TEST(SnapshotSlot, WakesWhoeverWaitsForANewerField) {
  using std::chrono::steady_clock;
  using namespace std::chrono_literals;
  SnapshotSlot slot;
  slot.publish(std::make_shared<NumberedField>(1));
  const auto first = slot.pin();
  const auto begin = steady_clock::now();
  slot.wait_for_newer(nullptr, begin + 1h);  // there is one already
  slot.wait_for_newer(first, begin + 20ms);
  EXPECT_GE(steady_clock::now() - begin, 20ms);
  EXPECT_EQ(slot.pin(), first);
  std::thread publisher([&] {
    std::this_thread::sleep_for(10ms);
    slot.publish(std::make_shared<NumberedField>(2));
  });
  slot.wait_for_newer(first, begin + 1h);
  EXPECT_EQ(slot.pin()->info().sequence, 2);
  publisher.join();
}

}  // namespace
}  // namespace sidestep
