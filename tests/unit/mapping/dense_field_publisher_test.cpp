#include <sidestep/mapping/dense_field_publisher.hpp>

#include <set>

#include <gtest/gtest.h>

#include "conformance/grid_map.hpp"

namespace sidestep {
namespace {

using conformance::GridMap;

class DenseFieldPublisherTest : public testing::Test {
 protected:
  /// A snapshot with the same value everywhere but in voxel (x, 0, 0), which has its own.
  std::shared_ptr<const DenseField> publish(const MapUpdate& update, float value, int x = 0,
                                            float own = 0.0f) {
    const auto changed = publisher_.begin(update);
    EXPECT_TRUE(changed) << changed.error().describe();
    return std::dynamic_pointer_cast<const DenseField>(publisher_.publish(
        update, *changed, [&](int from, int y, int z, int count, float* distances_m) {
          std::fill_n(distances_m, count, value);
          if (own != 0.0f && y == 0 && z == 0 && from <= x && x < from + count) {
            distances_m[x - from] = own;
          }
        }));
  }

  static std::size_t distinct(const DenseField& field) {
    std::set<const FieldBlock*> blocks;
    for (std::size_t b = 0; b < field.blocks().size(); ++b) blocks.insert(&field.blocks().block(b));
    return blocks.size();
  }

  static GridSpec grid() { return {Eigen::Vector3d::Zero(), 0.1, Eigen::Vector3i(48, 32, 32)}; }
  GridMap map_{grid()};
  WorkerPool workers_{2};
  DenseFieldPublisher publisher_{FieldInfo{.grid = grid(), .max_distance_m = 0.8}, map_, workers_};
};

TEST_F(DenseFieldPublisherTest, BlocksOfOneValueAreOneBlock) {
  const auto empty = publish(map_.take_update(), 0.8f);
  EXPECT_EQ(empty->blocks().size(), 12u);
  EXPECT_EQ(distinct(*empty), 1u);
  map_.set({20, 0, 0}, false);  // known now, which changes no distance
  const auto seen = publish(map_.take_update(), 0.8f);
  EXPECT_EQ(seen->blocks(), empty->blocks());
  EXPECT_TRUE(seen->known({20, 0, 0}));
  for (std::size_t b = 0; b < 12; ++b) {
    EXPECT_EQ(seen->known_blocks()[b] == empty->known_blocks()[b], b != 1) << b;
  }
}

TEST_F(DenseFieldPublisherTest, OnlyWhatTheUpdateNamesIsWritten) {
  const auto before = publish(map_.take_update(), 0.8f);
  map_.set({20, 0, 0}, true);
  const auto after = publish(map_.take_update(), 0.3f, 20, 0.1f);
  EXPECT_EQ(after->at({20, 0, 0}), 0.1f);
  EXPECT_EQ(after->at({21, 0, 0}), 0.3f);
  EXPECT_TRUE(after->known({20, 0, 0}));
  EXPECT_EQ(after->at({40, 0, 0}), 0.8f);
  EXPECT_EQ(before->at({20, 0, 0}), 0.8f);
  EXPECT_FALSE(before->known({20, 0, 0}));
  for (std::size_t b = 0; b < before->blocks().size(); ++b) {
    EXPECT_EQ(before->blocks()[b] == after->blocks()[b], b != 1) << b;
  }
}

TEST_F(DenseFieldPublisherTest, WhatComesOutEqualStaysShared) {
  map_.set({20, 0, 0}, true);
  const auto before = publish(map_.take_update(), 0.8f, 20, 0.1f);
  map_.set({20, 0, 0}, true);
  const auto after = publish(map_.take_update(), 0.8f, 20, 0.1f);
  EXPECT_EQ(before->blocks(), after->blocks());
  EXPECT_EQ(after->info().sequence, 2);
}

TEST_F(DenseFieldPublisherTest, RefusesUpdatesOutOfOrder) {
  const MapUpdate first = map_.take_update();
  MapUpdate third = map_.take_update();
  third.sequence = 3;
  ASSERT_TRUE(publisher_.begin(first));
  for (const MapUpdate& wrong : {first, third}) {
    const auto begun = publisher_.begin(wrong);
    ASSERT_FALSE(begun);
    EXPECT_EQ(begun.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(begun.error().message.find("in order"), std::string::npos);
  }
  MapUpdate second = third;
  second.sequence = 2;
  EXPECT_TRUE(publisher_.begin(second));
}

TEST_F(DenseFieldPublisherTest, RefusesBlocksThatAreNotThere) {
  for (const std::int32_t block : {-1, 12}) {
    MapUpdate update = map_.take_update();
    update.changed_blocks = {block};
    const auto begun = publisher_.begin(update);
    ASSERT_FALSE(begun);
    EXPECT_NE(begun.error().message.find(std::to_string(block)), std::string::npos);
  }
}

}  // namespace
}  // namespace sidestep
