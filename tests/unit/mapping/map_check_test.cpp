#include <sidestep/mapping/map_check.hpp>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "conformance/grid_map.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;

/// A map that lies where it is told to.
class LyingMap final : public conformance::GridMap {
 public:
  LyingMap() : GridMap(kGrid), grid_(kGrid), seen_grid_(kGrid) {}

  const GridSpec& grid() const noexcept override { return grid_; }
  const GridSpec& occupancy_grid() const noexcept override { return seen_grid_; }
  VoxelBits occupied() const noexcept override { return lie_ ? *lie_ : GridMap::occupied(); }

  void move(const Eigen::Vector3d& by_m) { grid_.origin_m = seen_grid_.origin_m += by_m; }

  static inline const GridSpec kGrid{Eigen::Vector3d::Zero(), 0.1, Eigen::Vector3i(70, 20, 10)};
  GridSpec grid_, seen_grid_;
  std::optional<VoxelBits> lie_;
};

class MapCheckTest : public testing::Test {
 protected:
  /// What is found after a frame whose voxel is seen, where `change` lies about that.
  std::string found(const std::function<void(MapUpdate&)>& change = {}) {
    map_.set({5 * seen_++ % 70, 3, 2}, true);
    MapUpdate update = map_.take_update();
    frame_.stamp = update.stamp;
    if (change) change(update);
    const auto kept = check_.check(frame_, update);
    if (kept) return "";
    EXPECT_EQ(kept.error().code, ErrorCode::kPlugin);
    return kept.error().message;
  }

  LyingMap map_;
  MapCheck check_{map_};
  Frame frame_;
  int seen_ = 0;
};

TEST_F(MapCheckTest, FindsNothingInAMapThatIsRight) {
  for (int i = 0; i < 30; ++i) ASSERT_EQ(found(), "");
  map_.move({1.6, 0.0, 0.0});
  EXPECT_EQ(found([](MapUpdate& update) { update.grid_moved = true; }), "");
  EXPECT_EQ(found(), "");
}

TEST_F(MapCheckTest, FindsAGridThatMovesInSilence) {
  EXPECT_EQ(found(), "");
  map_.move({1.6, 0.0, 0.0});
  EXPECT_EQ(found(), "its grid has moved, and the update does not say so");
}

TEST_F(MapCheckTest, FindsAGridOfAnotherSize) {
  map_.grid_.size_vox.z() = 11;
  EXPECT_EQ(found(), "its grid has another size or resolution than before");
  map_.grid_ = LyingMap::kGrid;
  map_.grid_.resolution_m = 0.2;
  EXPECT_EQ(found(), "its grid has another size or resolution than before");
}

TEST_F(MapCheckTest, FindsAViewOfAnotherGrid) {
  map_.seen_grid_.origin_m.x() = 0.1;
  EXPECT_EQ(found(), "the grid of its occupancy is another");
}

TEST_F(MapCheckTest, FindsBitsThatAreNotThere) {
  const VoxelBits right = map_.occupied();
  map_.lie_ = VoxelBits{};
  EXPECT_EQ(found(), "its occupied bits are 0 words of 0 a row, not those of its grid");
  map_.lie_ = VoxelBits{right.words.first(right.words.size() - 1), right.words_per_row};
  EXPECT_THAT(found(), HasSubstr("its occupied bits are 399 words of 2 a row"));
  map_.lie_ = VoxelBits{right.words.first(200), 1};  // for 64 of 70 voxels
  EXPECT_THAT(found(), HasSubstr("its occupied bits are 200 words of 1 a row"));
}

TEST_F(MapCheckTest, FindsUpdatesThatAreNotOfTheFrame) {
  EXPECT_EQ(found(), "");
  EXPECT_EQ(found([](MapUpdate& update) { update.stamp.ns += 1; }),
            "the update has another stamp than the frame");
  EXPECT_EQ(found([](MapUpdate& update) { update.sequence = 1; }), "update 1 follows update 1");
}

TEST_F(MapCheckTest, FindsBlocksThatAreNotOfTheGrid) {
  const auto with = [](std::vector<std::int32_t> blocks) {
    return [blocks](MapUpdate& update) { update.changed_blocks = blocks; };
  };
  EXPECT_EQ(found(with({0, 4, 9})), "");  // 5 x 2 x 1
  EXPECT_EQ(found(with({0, 10})), "block 10 is not in its grid");
  EXPECT_EQ(found(with({4, 4})), "changed blocks do not ascend");
  EXPECT_EQ(found(with({-1, 4})), "changed blocks do not ascend");
}

}  // namespace
}  // namespace sidestep
