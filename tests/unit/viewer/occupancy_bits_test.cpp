#include <sidestep/field/occupancy_bits.hpp>

#include <algorithm>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/opaque_field.hpp"
#include "view_messages.hpp"
#include "view_testing.hpp"

namespace sidestep {
namespace {

using testing_support::DecodedMap;
using testing_support::DecodedMessage;
using testing_support::small_field_info;

using RandomBlocks = std::vector<std::shared_ptr<const FieldBlock>>;
using RandomKnown = std::vector<std::shared_ptr<const KnownBlock>>;

std::shared_ptr<const FieldBlock> random_block(std::mt19937& random) {
  auto block = std::make_shared<FieldBlock>();
  std::uniform_real_distribution<float> distance_m(-0.1F, 0.5F);
  for (float& one : block->distance_m) one = distance_m(random);
  block->distance_m[random() % FieldBlock::kVoxels] = 0.0F;  // occupied, at the limit
  return block;
}

std::shared_ptr<const KnownBlock> random_known(std::mt19937& random) {
  auto block = std::make_shared<KnownBlock>();
  for (std::uint16_t& row : block->rows) row = static_cast<std::uint16_t>(random());
  return block;
}

/// The same distances in a block of its own.
std::shared_ptr<const FieldBlock> twin(const std::shared_ptr<const FieldBlock>& block) {
  return std::make_shared<const FieldBlock>(*block);
}

void expect_shows(const DecodedMap& map, const DenseField& field) {
  const Eigen::Vector3i size = field.info().grid.size_vox;
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x) {
        ASSERT_EQ(map.occupied(x, y, z), field.at({x, y, z}) <= 0.0F) << x << " " << y << " " << z;
        ASSERT_EQ(map.known(x, y, z), field.known({x, y, z})) << x << " " << y << " " << z;
      }
    }
  }
}

/// Voxel by voxel, which blocks differ in what is drawn of them.
std::vector<std::int32_t> blocks_that_differ(const DenseField& a, const DenseField& b) {
  const GridSpec& grid = a.info().grid;
  const Eigen::Vector3i counts = block_counts(grid);
  std::vector<std::int32_t> blocks;
  for (std::size_t i = 0; i < grid.voxel_count(); ++i) {
    const int v = static_cast<int>(i);
    const Eigen::Vector3i size = grid.size_vox;
    const Eigen::Vector3i voxel(v % size.x(), v / size.x() % size.y(), v / (size.x() * size.y()));
    const bool same =
        (a.at(voxel) <= 0.0F) == (b.at(voxel) <= 0.0F) && a.known(voxel) == b.known(voxel);
    if (!same) blocks.push_back(block_linear(voxel / kBlockSide_vox, counts));
  }
  std::ranges::sort(blocks);
  const auto rest = std::ranges::unique(blocks);
  blocks.erase(rest.begin(), rest.end());
  return blocks;
}

TEST(OccupancyBits, FollowFieldsThatShareBlocks) {
  std::mt19937 random(1);
  const FieldInfo info = small_field_info();
  const auto count = static_cast<std::size_t>(block_counts(info.grid).prod());
  RandomBlocks blocks;
  RandomKnown known;
  for (std::size_t i = 0; i < count; ++i) {
    blocks.push_back(random_block(random));
    known.push_back(random_known(random));
  }
  OccupancyBits bits;
  DecodedMap page;
  std::shared_ptr<const DenseField> before;
  int partial = 0;
  for (int round = 0; round < 30; ++round) {
    const std::size_t i = random() % count;
    switch (round % 4) {
      case 0: blocks[i] = random_block(random); break;
      case 1: known[i] = random_known(random); break;
      case 2: blocks[i] = twin(blocks[i]); break;  // another block that looks the same
      default: break;
    }
    const auto field = std::make_shared<const DenseField>(info, blocks, known);
    const auto change = bits.update(field);
    ASSERT_EQ(change.is_new_grid, round == 0);
    if (before != nullptr) {
      EXPECT_EQ(change.blocks, blocks_that_differ(*before, *field));
      partial += static_cast<int>(change.blocks.size());
    }
    page.apply(DecodedMessage(*map_message({}, {}, bits, change.blocks, change.is_new_grid).bytes));
    expect_shows(page, *field);
    before = field;
  }
  EXPECT_GT(partial, 10);
}

TEST(OccupancyBits, FullMessageShowsWhatChangesHaveLedTo) {
  OccupancyBits bits;
  (void)bits.update(testing_support::ball_field({0.0, 1.0, 1.0}));
  const auto field = testing_support::ball_field({1.5, 1.0, 1.0});
  (void)bits.update(field);
  DecodedMap page;
  page.apply(DecodedMessage(*map_message({}, {}, bits, bits.filled(), true).bytes));
  expect_shows(page, *field);
}

TEST(OccupancyBits, EmptyBlocksAreNotFilled) {
  const FieldInfo info = small_field_info();
  const auto count = static_cast<std::size_t>(block_counts(info.grid).prod());
  auto far = std::make_shared<FieldBlock>();
  far->distance_m.fill(0.5F);
  auto one = std::make_shared<KnownBlock>();
  one->rows[0] = 1;
  RandomKnown known(count, std::make_shared<const KnownBlock>());
  known[3] = one;
  OccupancyBits bits;
  (void)bits.update(std::make_shared<const DenseField>(info, RandomBlocks(count, far), known));
  EXPECT_THAT(bits.filled(), ::testing::ElementsAre(3));
}

TEST(OccupancyBits, FieldsWithoutBlocksAreSampledAtTheCentresOfVoxels) {
  OccupancyBits bits;
  DecodedMap page;
  for (const double x_m : {0.0, 0.3, 1.9}) {
    const auto field = testing_support::ball_field({x_m, 1.2, 1.1});
    const auto change = bits.update(std::make_shared<const testing_support::OpaqueField>(field));
    page.apply(DecodedMessage(*map_message({}, {}, bits, change.blocks, change.is_new_grid).bytes));
    expect_shows(page, *field);
  }
}

TEST(OccupancyBits, AnotherGridBeginsAnew) {
  OccupancyBits bits;
  (void)bits.update(testing_support::ball_field({0.0, 1.0, 1.0}));
  FieldInfo moved = small_field_info();
  moved.grid.origin_m.x() += 0.1;
  const auto field = testing_support::ball_field({0.0, 1.0, 1.0}, moved);
  const auto change = bits.update(field);
  EXPECT_TRUE(change.is_new_grid);
  EXPECT_EQ(bits.grid(), moved.grid);
  DecodedMap page;
  page.apply(DecodedMessage(*map_message({}, {}, bits, change.blocks, true).bytes));
  expect_shows(page, *field);
}

TEST(OccupancyBits, GridsBeyondTheBoundAreNotDrawn) {
  FieldInfo info = small_field_info();
  info.grid.size_vox = {1 << 10, 1 << 10, 1 << 10};
  OccupancyBits bits;
  class Vast final : public DistanceField {
   public:
    using DistanceField::DistanceField;
    void query(std::span<const Eigen::Vector3d>, std::span<double>, std::span<Eigen::Vector3d>,
               std::span<FieldStatus>) const noexcept override {
      ADD_FAILURE() << "looked at";
    }
  };
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(bits.update(std::make_shared<const Vast>(info)).blocks.empty());
    EXPECT_TRUE(bits.filled().empty());
  }
}

}  // namespace
}  // namespace sidestep
