#include "closest_obstacles.hpp"

#include <cmath>
#include <map>
#include <random>
#include <set>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "error_bound.hpp"

namespace sidestep::incremental {
namespace {

using Voxels = std::vector<Eigen::Vector3i>;

/// A grid of obstacles that is changed step by step, with everything found by searching.
class Playground {
 public:
  Playground(const Eigen::Vector3i& size, unsigned seed)
      : size_(size), random_(seed), occupied_(static_cast<std::size_t>(size.prod())) {}

  [[nodiscard]] int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }
  [[nodiscard]] const Eigen::Vector3i& size() const { return size_; }
  [[nodiscard]] bool contains(const Eigen::Vector3i& v) const {
    return (v.array() >= 0).all() && (v.array() < size_.array()).all();
  }
  [[nodiscard]] bool occupied(const Eigen::Vector3i& v) const { return occupied_[linear(v)]; }
  void fill(bool occupied) { occupied_.assign(occupied_.size(), occupied); }

  void set_box(const Eigen::Vector3i& low, const Eigen::Vector3i& high, bool occupied) {
    for (int z = std::max(0, low.z()); z <= std::min(high.z(), size_.z() - 1); ++z) {
      for (int y = std::max(0, low.y()); y <= std::min(high.y(), size_.y() - 1); ++y) {
        for (int x = std::max(0, low.x()); x <= std::min(high.x(), size_.x() - 1); ++x) {
          occupied_[linear({x, y, z})] = occupied;
        }
      }
    }
  }

  /// Boxes that walk through the whole grid and out of it, boxes that come and go, and false
  /// points that last one step.
  void step() {
    for (Walker& w : walkers_) set_box(w.low, w.low + w.side, false);
    std::erase_if(walkers_, [&](Walker& w) {
      w.low += w.velocity;
      return (w.low.array() > size_.array() + 4).any() || (w.low.array() < -8).any();
    });
    while (walkers_.size() < 3) {
      Walker w{{below(size_.x()), below(size_.y()), below(size_.z())},
               {below(4), below(4), below(4)},
               {below(5) - 2, below(5) - 2, below(5) - 2}};
      walkers_.push_back(w);
    }
    if (below(3) == 0) {
      const Eigen::Vector3i low(below(size_.x()), below(size_.y()), below(size_.z()));
      set_box(low, low + Eigen::Vector3i(below(6), below(6), below(3)), below(5) < 2);
    }
    set_box(false_point_, false_point_, false);
    false_point_ = {below(size_.x()), below(size_.y()), below(size_.z())};
    set_box(false_point_, false_point_, true);
    for (const Walker& w : walkers_) set_box(w.low, w.low + w.side, true);
    if (below(200) == 0) fill(below(4) == 0);
  }

  [[nodiscard]] std::vector<bool> state() const { return occupied_; }

  /// What has changed since `before`, in two queues.
  [[nodiscard]] std::pair<Voxels, Voxels> removed_and_inserted(const std::vector<bool>& before) {
    std::pair<Voxels, Voxels> queues;
    for_each([&](const Eigen::Vector3i& v) {
      const std::size_t at = linear(v);
      if (before[at] == occupied_[at]) return;
      (occupied_[at] ? queues.second : queues.first).push_back(v);
    });
    std::ranges::shuffle(queues.first, random_);
    std::ranges::shuffle(queues.second, random_);
    return queues;
  }

  template <class Visit>
  void for_each(Visit&& visit) const {
    for (int z = 0; z < size_.z(); ++z) {
      for (int y = 0; y < size_.y(); ++y) {
        for (int x = 0; x < size_.x(); ++x) visit(Eigen::Vector3i(x, y, z));
      }
    }
  }
  [[nodiscard]] Voxels obstacles() const {
    Voxels all;
    for_each([&](const Eigen::Vector3i& v) {
      if (occupied(v)) all.push_back(v);
    });
    return all;
  }

 private:
  struct Walker {
    Eigen::Vector3i low, side, velocity;
  };
  [[nodiscard]] std::size_t linear(const Eigen::Vector3i& v) const {
    return static_cast<std::size_t>(v.x() + size_.x() * (v.y() + size_.y() * v.z()));
  }

  Eigen::Vector3i size_;
  std::mt19937 random_;
  std::vector<bool> occupied_;
  std::vector<Walker> walkers_;
  Eigen::Vector3i false_point_{0, 0, 0};
};

/// Every list names the voxels whose closest obstacle its head is, in both directions, and every
/// distance is the one to the closest obstacle named.
template <class Value>
void expect_consistent(const ClosestObstacles<Value>& closest, const Playground& truth) {
  int with_obstacle = 0;
  truth.for_each([&](const Eigen::Vector3i& v) {
    const auto obstacle = closest.closest(v);
    const std::uint32_t distance2 = closest.row(v.y(), v.z())[v.x()];
    if (!obstacle) {
      ASSERT_FALSE(truth.occupied(v));
      ASSERT_EQ(distance2, closest.cap());
      return;
    }
    ++with_obstacle;
    ASSERT_TRUE(truth.contains(*obstacle) && truth.occupied(*obstacle));
    ASSERT_EQ(distance2, static_cast<std::uint32_t>((*obstacle - v).squaredNorm()));
    ASSERT_LT(distance2, closest.cap());
    ASSERT_TRUE(!truth.occupied(v) || *obstacle == v);
  });
  if (testing::Test::HasFatalFailure()) return;
  int in_lists = 0;
  for (const Eigen::Vector3i& obstacle : truth.obstacles()) {
    Eigen::Vector3i v = obstacle;
    do {
      ASSERT_EQ(closest.closest(v), obstacle);
      ASSERT_EQ(closest.previous(closest.next(v)), v);
      ASSERT_LE(++in_lists, with_obstacle) << "a list that does not close";
      v = closest.next(v);
    } while (v != obstacle);
  }
  ASSERT_EQ(in_lists, with_obstacle);
}

/// No voxel would be nearer to the closest obstacle of a neighbour than to its own.
template <class Value>
void expect_settled(const ClosestObstacles<Value>& closest, const Playground& truth,
                    const Voxels& steps) {
  truth.for_each([&](const Eigen::Vector3i& v) {
    for (const Eigen::Vector3i& step : steps) {
      const Eigen::Vector3i neighbour = v + step;
      const auto obstacle = truth.contains(neighbour) ? closest.closest(neighbour) : std::nullopt;
      if (!obstacle) continue;
      const auto offered = static_cast<std::uint32_t>((*obstacle - v).squaredNorm());
      ASSERT_LE(closest.row(v.y(), v.z())[v.x()], std::min(offered, closest.cap()));
    }
  });
}

/// Too large by no more than `bound_vox`, never too small.
template <class Value>
void expect_near_brute_force(const ClosestObstacles<Value>& closest, const Playground& truth,
                             double bound_vox) {
  const Voxels obstacles = truth.obstacles();
  truth.for_each([&](const Eigen::Vector3i& v) {
    auto exact = static_cast<int>(closest.cap());
    for (const Eigen::Vector3i& obstacle : obstacles) {
      exact = std::min(exact, (obstacle - v).squaredNorm());
    }
    const int distance2 = closest.row(v.y(), v.z())[v.x()];
    ASSERT_GE(distance2, exact);
    ASSERT_LE(std::sqrt(distance2), std::sqrt(exact) + bound_vox) << v.transpose();
  });
}

class ClosestObstaclesIn : public testing::TestWithParam<std::tuple<Eigen::Vector3i, int, int>> {};

TEST_P(ClosestObstaclesIn, HoldsItsInvariantsOverThousandsOfSteps) {
  const auto& [size, connectivity, cap] = GetParam();
  const auto steps = neighbourhood(connectivity);
  const double bound_vox = detour_vox(connectivity, std::sqrt(cap));
  Playground truth(size, 5);
  using Lists = ClosestObstacles<std::uint16_t>;
  Lists closest(size, static_cast<std::uint32_t>(cap), steps, Lists::Start::kNoObstacles);
  for (int step = 0; step < 1000; ++step) {
    SCOPED_TRACE(step);
    const std::vector<bool> before = truth.state();
    truth.step();
    const auto [removed, inserted] = truth.removed_and_inserted(before);
    closest.update(removed, inserted);
    expect_consistent(closest, truth);
    expect_settled(closest, truth, steps);
    if (step % 20 == 0) expect_near_brute_force(closest, truth, bound_vox);
    if (HasFatalFailure()) return;
  }
}

INSTANTIATE_TEST_SUITE_P(SizesAndNeighbourhoods, ClosestObstaclesIn,
                         testing::Combine(testing::Values(Eigen::Vector3i(35, 18, 7),
                                                          Eigen::Vector3i(16, 33, 5),
                                                          Eigen::Vector3i(1, 40, 34)),
                                          testing::Values(6, 18, 24, 26),
                                          testing::Values(9, 100, 4000)));

TEST(ClosestObstacles, StartsWithAllObstaclesForTheInverseOfAnEmptyMap) {
  const Eigen::Vector3i size(20, 17, 9);
  const auto steps = neighbourhood(26);
  Playground truth(size, 1);
  truth.fill(true);
  using Lists = ClosestObstacles<std::uint32_t>;
  Lists closest(size, 400, steps, Lists::Start::kAllObstacles);
  expect_consistent(closest, truth);
  const std::vector<bool> before = truth.state();
  truth.set_box({2, 2, 2}, {17, 14, 7}, false);
  const auto [removed, inserted] = truth.removed_and_inserted(before);
  closest.update(removed, inserted);
  expect_consistent(closest, truth);
  expect_near_brute_force(closest, truth, 0.0);
}

TEST(ClosestObstacles, TellsTheTilesInWhichDistancesChanged) {
  const Eigen::Vector3i size(50, 20, 10);
  const auto steps = neighbourhood(24);
  Playground truth(size, 3);
  using Lists = ClosestObstacles<std::uint16_t>;
  Lists closest(size, 30, steps, Lists::Start::kNoObstacles);
  const auto distances = [&] {
    std::map<std::tuple<int, int, int>, std::vector<int>> by_tile;
    truth.for_each([&](const Eigen::Vector3i& v) {
      by_tile[{v.x() / Lists::kTile_vox * Lists::kTile_vox, v.y(), v.z()}].push_back(
          closest.row(v.y(), v.z())[v.x()]);
    });
    return by_tile;
  };
  for (int step = 0; step < 100; ++step) {
    const auto values_before = distances();
    const std::vector<bool> before = truth.state();
    truth.step();
    const auto [removed, inserted] = truth.removed_and_inserted(before);
    closest.update(removed, inserted);
    std::set<std::tuple<int, int, int>> touched;
    closest.take_touched([&](int x, int y, int z) { touched.insert({x, y, z}); });
    for (const auto& [tile, values] : distances()) {
      ASSERT_TRUE(values == values_before.at(tile) || touched.contains(tile));
    }
    closest.take_touched([](int, int, int) { FAIL() << "told twice"; });
  }
}

TEST(ClosestObstacles, KnowsWhichGridsItCanIndex) {
  using Narrow = ClosestObstacles<std::uint16_t>;
  using Wide = ClosestObstacles<std::uint32_t>;
  EXPECT_TRUE(Narrow::fits({320, 320, 128}, 1024));
  EXPECT_FALSE(Narrow::fits({320, 320, 128}, 221184)) << "more than 16 bits";
  EXPECT_TRUE(Wide::fits({320, 320, 128}, 221184));
  EXPECT_TRUE(Wide::fits({1024, 1024, 256}, 1024 * 1024 * 3));
  EXPECT_FALSE(Wide::fits({1026, 16, 16}, 1026 * 1026 * 3)) << "an offset of 1025";
  EXPECT_TRUE(Wide::fits({5000, 16, 16}, 1024)) << "the cap keeps offsets short";
  EXPECT_FALSE(Wide::fits({4096, 4096, 256}, 1024)) << "more than 2^31 voxels";
}

TEST(Offset, AddsStepsWithoutUnpacking) {
  for (const int x : {-1023, -1, 0, 1, 1023}) {
    for (const int y : {-1023, -1, 0, 7, 1023}) {
      for (const int z : {-511, -1, 0, 1, 511}) {
        const Offset offset = Offset::of(x, y, z);
        EXPECT_TRUE(offset.exists());
        EXPECT_EQ(std::tuple(offset.x(), offset.y(), offset.z()), std::tuple(x, y, z));
        const Offset back{offset.bits - Offset::difference(x, y, z)};
        EXPECT_EQ(std::tuple(back.x(), back.y(), back.z()), std::tuple(0, 0, 0));
      }
    }
  }
  EXPECT_FALSE(Offset().exists());
}

}  // namespace
}  // namespace sidestep::incremental
