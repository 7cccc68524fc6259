#include <algorithm>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/mapping/moving_obstacles.hpp>

namespace sidestep {
namespace {

/// A map of 70 x 40 x 12 voxels of 0.1 m, more than a word a row, all of it known and free.
class HandMadeMap final : public OccupancyView {
 public:
  HandMadeMap() {
    grid_.resolution_m = 0.1;
    grid_.size_vox = {70, 40, 12};
    clear();
  }
  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return grid_; }
  [[nodiscard]] VoxelBits occupied() const noexcept override { return {occupied_, kWordsPerRow}; }
  [[nodiscard]] VoxelBits known() const noexcept override { return {known_, kWordsPerRow}; }

  GridSpec& grid() { return grid_; }
  void clear() {
    occupied_.assign(static_cast<std::size_t>(kWordsPerRow) * 40 * 12, 0);
    known_.assign(occupied_.size(), ~std::uint64_t{0});
  }
  void forget() { known_.assign(known_.size(), 0); }
  void see(const Eigen::Vector3i& lower, const Eigen::Vector3i& upper) {
    const std::vector<std::uint64_t> occupied = occupied_;
    fill(lower, upper);
    occupied_ = occupied;
  }
  void fill(const Eigen::Vector3i& lower, const Eigen::Vector3i& upper) {
    for (int k = lower.z(); k <= upper.z(); ++k) {
      for (int j = lower.y(); j <= upper.y(); ++j) {
        for (int i = lower.x(); i <= upper.x(); ++i) {
          const auto word = static_cast<std::size_t>((j + 40 * k) * kWordsPerRow + i / 64);
          occupied_[word] |= std::uint64_t{1} << (i % 64);
          known_[word] |= std::uint64_t{1} << (i % 64);
        }
      }
    }
  }

 private:
  static constexpr int kWordsPerRow = 2;
  GridSpec grid_;
  std::vector<std::uint64_t> occupied_, known_;
};

const Eigen::Vector3d kEye_m{3.5, -3.0, 0.6};

Stamp at(double time_s) { return Stamp::from_seconds(time_s); }

bool covers(const MovingObstacles& moving, const Eigen::Vector3d& p) {
  for (const MovingBall& ball : moving.balls) {
    if ((ball.centre_m - p).norm() <= ball.radius_m) return true;
  }
  return false;
}

TEST(MotionDetector, FindsWhatMovesWhereItHasMovedTo) {
  HandMadeMap map;
  MotionDetector detector;
  // Along x, past the end of a word, by a voxel every 0.1 s.
  for (int step = 0; step < 20; ++step) {
    map.clear();
    const int x = 45 + step;
    map.fill({x, 10, 2}, {x + 3, 14, 8});
    const auto moving = detector.update(map, kEye_m, at(0.1 * step));
    EXPECT_EQ(moving->stamp, at(0.1 * step));
    if (step < 2) {
      EXPECT_TRUE(moving->balls.empty()) << "it has not moved by two voxels yet";
      continue;
    }
    const Eigen::Vector3d front = map.grid().centre_m({x + 3, 12, 5});
    EXPECT_TRUE(covers(*moving, front)) << step;
    for (const MovingBall& ball : moving->balls) {
      EXPECT_GT(ball.centre_m.x(), 4.5);
      EXPECT_LT(ball.radius_m, 0.4);
    }
  }
  // It stands, and after the memory and a half is an obstacle like any other.
  std::size_t balls = 1;
  for (int step = 20; step < 37; ++step)
    balls = detector.update(map, kEye_m, at(0.1 * step))->balls.size();
  EXPECT_EQ(balls, 0U);
}

TEST(MotionDetector, CoversEveryVoxelThatMovedFarEnough) {
  HandMadeMap map;
  MotionDetector detector({.memory_s = 1.0, .cell_m = 0.25, .least_vox = 1});
  map.fill({10, 10, 2}, {12, 12, 4});
  (void)detector.update(map, kEye_m, at(0.0));
  map.clear();
  map.fill({14, 20, 2}, {16, 22, 4});
  const auto moving = detector.update(map, kEye_m, at(0.5));
  for (int i = 14; i <= 16; ++i) {
    for (int j = 20; j <= 22; ++j) EXPECT_TRUE(covers(*moving, map.grid().centre_m({i, j, 3})));
  }
  EXPECT_FALSE(covers(*moving, map.grid().centre_m({11, 11, 3})));
}

TEST(MotionDetector, TakesWhatComesIntoViewForStanding) {
  HandMadeMap map;
  map.forget();
  MotionDetector detector;
  (void)detector.update(map, kEye_m, at(0.0));
  map.fill({20, 10, 0}, {24, 20, 11});
  EXPECT_TRUE(detector.update(map, kEye_m, at(0.5))->balls.empty());
}

TEST(MotionDetector, TakesWhatComesIntoRangeForStanding) {
  // A wall stood just beyond the free space that was seen. Voxels before it are occupied by noise.
  const auto balls_with_free = [](int free_to_x) {
    HandMadeMap map;
    map.forget();
    map.see({0, 0, 0}, {free_to_x, 39, 11});
    MotionDetector detector;
    const Eigen::Vector3d eye_m(0.0, 2.0, 0.6);
    (void)detector.update(map, eye_m, at(0.0));
    map.fill({50, 10, 2}, {51, 20, 9});
    return detector.update(map, eye_m, at(0.5))->balls.size();
  };
  EXPECT_EQ(balls_with_free(50), 0U);
  EXPECT_GT(balls_with_free(54), 0U) << "something that has come";
}

TEST(MotionDetector, IgnoresWhatFlickersBesideWhatStands) {
  HandMadeMap map;
  MotionDetector detector;
  for (int step = 0; step < 40; ++step) {
    map.clear();
    const int flicker = step % 2;
    map.fill({30, 0, 0}, {31 + flicker, 39, 11});
    EXPECT_TRUE(detector.update(map, kEye_m, at(0.1 * step))->balls.empty()) << step;
  }
}

TEST(MotionDetector, IgnoresWhatFlickersWhereItIsLookedAlong) {
  // The underside of a board in voxels of 2.5 cm: two rows of it are found where others had been
  // cleared.
  const auto balls_from = [](const Eigen::Vector3d& eye_m, int rows) {
    HandMadeMap map;
    map.grid().resolution_m = 0.025;
    MotionDetector detector;
    map.fill({40, 0, 10}, {44, 39, 10});
    (void)detector.update(map, eye_m, at(0.0));
    map.fill({50, 0, 10}, {49 + rows, 39, 10});
    return detector.update(map, eye_m, at(0.5))->balls.size();
  };
  const Eigen::Vector3d below_m(1.2, 0.5, -0.5), level_m(0.0, 0.5, 0.1);
  EXPECT_EQ(balls_from(level_m, 2), 0U);
  EXPECT_GT(balls_from(below_m, 2), 0U) << "what had been free indeed";
  EXPECT_GT(balls_from(level_m, 6), 0U) << "a board that has come";
}

TEST(MotionDetector, TakesWhatWasHiddenForStanding) {
  HandMadeMap map;
  MotionDetector detector;
  map.fill({30, 10, 0}, {40, 10, 11});
  (void)detector.update(map, kEye_m, at(0.0));
  // Now its far side is seen, too; and something has come to where nothing hid it.
  map.fill({30, 14, 0}, {40, 14, 11});
  EXPECT_TRUE(detector.update(map, Eigen::Vector3d(3.5, 6.0, 0.6), at(0.5))->balls.empty());
  map.fill({30, 5, 0}, {33, 6, 11});
  const auto moving = detector.update(map, kEye_m, at(0.6));
  EXPECT_TRUE(covers(*moving, map.grid().centre_m({31, 5, 5})));
  EXPECT_FALSE(covers(*moving, map.grid().centre_m({35, 14, 5})));
}

TEST(MotionDetector, JoinsWhatCamerasSeeThatTakeTurns) {
  HandMadeMap map;
  map.forget();
  MotionDetector detector;
  const Eigen::Vector3d other_eye_m(3.5, 7.0, 0.6);
  map.see({0, 0, 0}, {69, 9, 11});
  map.fill({20, 10, 0}, {50, 10, 11});  // hides what is behind it from one of them
  (void)detector.update(map, kEye_m, at(0.0));
  map.see({0, 11, 0}, {69, 39, 11});
  (void)detector.update(map, other_eye_m, at(0.05));
  map.fill({33, 20, 2}, {36, 23, 8});
  EXPECT_TRUE(covers(*detector.update(map, kEye_m, at(0.3)), map.grid().centre_m({34, 21, 5})));
}

/// Whether a segment passes through the inside of a voxel, by the slabs between its faces.
bool passes_through(const GridSpec& grid, const Eigen::Vector3i& voxel, const Eigen::Vector3d& from,
                    const Eigen::Vector3d& to) {
  const Eigen::Vector3d lower = grid.origin_m + voxel.cast<double>() * grid.resolution_m;
  double enter = 0.0, leave = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (lower[axis] - from[axis]) / (to[axis] - from[axis]);
    const double b = a + grid.resolution_m / (to[axis] - from[axis]);
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter < leave;
}

TEST(MotionDetector, TakesExactlyWhatWasHiddenForHidden) {
  std::mt19937 random(41);
  int hidden = 0, seen = 0, noise = 0;
  for (int trial = 0; trial < 40; ++trial) {
    HandMadeMap map;
    const GridSpec& grid = map.grid();
    const auto any_voxel = [&] {
      Eigen::Vector3i voxel;
      for (int axis = 0; axis < 3; ++axis) {
        voxel[axis] = std::uniform_int_distribution(0, grid.size_vox[axis] - 1)(random);
      }
      return voxel;
    };
    std::vector<Eigen::Vector3i> then;
    for (int i = 0; i < 300; ++i) {
      then.push_back(any_voxel());
      map.fill(then.back(), then.back());
    }
    // Inside the map, and outside of it.
    std::uniform_real_distribution<double> share(-0.3, 1.3);
    const Eigen::Vector3d eye =
        grid.origin_m + Eigen::Vector3d(share(random), share(random), share(random))
                            .cwiseProduct(grid.upper_m() - grid.origin_m);
    // One ball a voxel.
    MotionDetector detector({.memory_s = 1.0, .cell_m = grid.resolution_m, .least_vox = 1});
    (void)detector.update(map, eye, at(0.0));
    std::vector<Eigen::Vector3i> now;
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector3i voxel = any_voxel();
      const auto is_beside = [&](const Eigen::Vector3i& other) {
        return (voxel - other).cwiseAbs().maxCoeff() <= 1;
      };
      if (std::ranges::none_of(then, is_beside)) now.push_back(voxel);
    }
    for (const Eigen::Vector3i& voxel : now) map.fill(voxel, voxel);
    const auto moving = detector.update(map, eye, at(0.5));
    for (const Eigen::Vector3i& voxel : now) {
      const Eigen::Vector3d p = grid.centre_m(voxel);
      const Eigen::Vector3d beside =
          p + std::min(1.5 * grid.resolution_m, (eye - p).norm()) * (eye - p).normalized();
      const bool is_hidden = std::ranges::any_of(then, [&](const Eigen::Vector3i& other) {
        return passes_through(grid, other, beside, eye);
      });
      // Three standard deviations of a structured-light camera's depth.
      const Eigen::Vector3d noise_end = p + 0.006 * (p - eye).norm() * (p - eye);
      const bool is_noise = std::ranges::any_of(then, [&](const Eigen::Vector3i& other) {
        return passes_through(grid, other, p, noise_end);
      });
      const bool is_found = std::ranges::any_of(moving->balls, [&](const MovingBall& ball) {
        return (ball.centre_m - p).norm() < 0.1 * grid.resolution_m;
      });
      EXPECT_EQ(is_found, !is_hidden && !is_noise) << trial << ": " << voxel.transpose();
      ++(is_noise ? noise : is_hidden ? hidden : seen);
    }
  }
  EXPECT_GT(hidden, 200);
  EXPECT_GT(seen, 200);
  EXPECT_GT(noise, 5);
}

TEST(MotionDetector, LeavesOutCellsWithTooFewVoxels) {
  HandMadeMap map;
  MotionDetector detector({.least_vox = 3});
  (void)detector.update(map, kEye_m, at(0.0));
  map.fill({5, 5, 5}, {5, 6, 5});
  EXPECT_TRUE(detector.update(map, kEye_m, at(0.5))->balls.empty());
}

TEST(MotionDetector, BeginsAnewWhereTheGridMovesOrTimeGoesBack) {
  HandMadeMap map;
  MotionDetector detector;
  (void)detector.update(map, kEye_m, at(1.0));
  map.fill({20, 10, 2}, {24, 14, 6});
  map.grid().origin_m.x() += 1.6;
  EXPECT_TRUE(detector.update(map, kEye_m, at(1.5))->balls.empty());
  map.clear();
  map.fill({40, 10, 2}, {44, 14, 6});
  EXPECT_TRUE(detector.update(map, kEye_m, at(0.5))->balls.empty());
}

/// What a camera at the origin sees that looks along x: something at one depth all over.
Frame frame_at(double time_s, double depth_m) {
  DepthImage image;
  image.camera = {160, 120, 138.6, 138.6, 79.5, 59.5};  // 60 x 47 degrees
  image.depth_m.assign(160 * 120, static_cast<float>(depth_m));
  Frame frame;
  frame.stamp = Stamp::from_seconds(time_s);
  frame.T_world_camera = T_forward_optical();
  frame.measurement = std::move(image);
  return frame;
}

MovingObstacles moving_at(double time_s, std::vector<Eigen::Vector3d> places_m) {
  MovingObstacles moving;
  moving.stamp = Stamp::from_seconds(time_s);
  for (const Eigen::Vector3d& p_m : places_m) moving.balls.push_back({p_m, 0.2});
  return moving;
}

class Memory : public ::testing::Test {
 protected:
  /// What is known to move after a frame in which `found` was detected.
  std::vector<MovingBall> after(double time_s, double depth_m,
                                std::vector<Eigen::Vector3d> found = {}) {
    MovingObstacles moving = moving_at(time_s, std::move(found));
    memory_.add_unseen(frame_at(time_s, depth_m), moving);
    return moving.balls;
  }
  MotionMemory memory_;
};

constexpr double kFar_m = 4.0;
const Eigen::Vector3d kBeside(1.0, 1.5, 0.0);  // of the image

TEST_F(Memory, KeepsWhatIsBesideTheImageForThreeSeconds) {
  ASSERT_EQ(after(1.0, kFar_m, {kBeside}).size(), 1U);
  for (const double time_s : {1.1, 2.5, 4.0}) {
    const auto balls = after(time_s, kFar_m);
    ASSERT_EQ(balls.size(), 1U) << time_s;
    EXPECT_EQ(balls[0].centre_m, kBeside);
    EXPECT_EQ(balls[0].seen, Stamp::from_seconds(1.0));
  }
  EXPECT_TRUE(after(4.1, kFar_m).empty());
}

TEST_F(Memory, ForgetsWhatAnImageShowsToBeGone) {
  ASSERT_EQ(after(1.0, kFar_m, {{2.0, 0.0, 0.0}}).size(), 1U);
  EXPECT_TRUE(after(1.1, kFar_m).empty());
  EXPECT_TRUE(after(1.2, kFar_m).empty());
}

TEST_F(Memory, KeepsWhatIsHiddenAndWhereNothingCameBack) {
  for (const double depth_m : {1.0, 0.0}) {
    memory_ = {};
    ASSERT_EQ(after(1.0, kFar_m, {{2.0, 0.0, 0.0}}).size(), 1U);
    EXPECT_EQ(after(1.1, depth_m).size(), 1U) << depth_m;
  }
}

TEST_F(Memory, KeepsNothingTwice) {
  ASSERT_EQ(after(1.0, kFar_m, {kBeside}).size(), 1U);
  const auto balls = after(1.1, kFar_m, {kBeside + Eigen::Vector3d(0.0, 0.05, 0.0)});
  ASSERT_EQ(balls.size(), 1U);
  EXPECT_FALSE(balls[0].seen.has_value());
  // From then on it is that which is kept.
  EXPECT_EQ(after(1.2, kFar_m)[0].seen, Stamp::from_seconds(1.1));
}

TEST_F(Memory, StartsOverWhereStampsGoBack) {
  ASSERT_EQ(after(5.0, kFar_m, {kBeside}).size(), 1U);
  EXPECT_TRUE(after(1.0, kFar_m).empty());
}

}  // namespace
}  // namespace sidestep
