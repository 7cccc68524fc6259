// Paths of straight lines whose corners are rounded off.
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/trajectory/blend.hpp>
#include <sidestep/trajectory/retime.hpp>

namespace sidestep {
namespace {

Trajectory path_through(const std::vector<Eigen::VectorXd>& states) {
  Trajectory path = make_trajectory(static_cast<int>(states.front().size()),
                                    static_cast<int>(states.size()), 1.0);
  for (int i = 0; i < path.size(); ++i) {
    std::ranges::copy(states[static_cast<std::size_t>(i)], path.q(i).begin());
  }
  return path;
}

Trajectory random_polyline(int dof, int vertices, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Trajectory path = make_trajectory(dof, vertices, 1.0);
  for (double& q : path.positions) q = normal(random);
  return path;
}

struct Sample {
  Eigen::VectorXd q;
  Eigen::VectorXd qdot;
};

std::vector<Sample> samples(const Trajectory& path, int count) {
  std::vector<Sample> all;
  for (int i = 0; i <= count; ++i) {
    Sample sample{Eigen::VectorXd(path.dof), Eigen::VectorXd(path.dof)};
    path.sample(path.duration_s() * i / count, {sample.q.data(), sample.q.data() + path.dof},
                {sample.qdot.data(), sample.qdot.data() + path.dof});
    all.push_back(sample);
  }
  return all;
}

double distance_to_line(const Eigen::VectorXd& q, const Eigen::VectorXd& a,
                        const Eigen::VectorXd& b) {
  const Eigen::VectorXd line = b - a;
  const double share = std::clamp((q - a).dot(line) / line.squaredNorm(), 0.0, 1.0);
  return (q - a - share * line).norm();
}

double distance_to(const Trajectory& polyline, const Eigen::VectorXd& q) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int i = 0; i + 1 < polyline.size(); ++i) {
    const Eigen::Map<const Eigen::VectorXd> a(polyline.q(i).data(), polyline.dof);
    const Eigen::Map<const Eigen::VectorXd> b(polyline.q(i + 1).data(), polyline.dof);
    nearest = std::min(nearest, distance_to_line(q, a, b));
  }
  return nearest;
}

TEST(BlendCorners, ARightAngleBecomesTheParabolaWithinIt) {
  const Trajectory path =
      path_through({Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 0), Eigen::Vector2d(1, 2)});
  const auto blended = blend_corners(path, 0.2);
  ASSERT_TRUE(blended) << blended.error().describe();
  // It touches the axes of the corner at 0.2: sqrt(u) + sqrt(v) = sqrt(0.2), with u and v from
  // there.
  double nearest = 1.0;
  for (const Sample& sample : samples(*blended, 4000)) {
    const double u = 1.0 - sample.q.x(), v = sample.q.y();
    nearest = std::min(nearest, std::hypot(u, v));
    if (u > 0.2 || v > 0.2) {
      EXPECT_LT(std::min(std::abs(u), std::abs(v)), 1e-12);
    } else {
      EXPECT_NEAR(std::sqrt(std::max(0.0, u)) + std::sqrt(std::max(0.0, v)), std::sqrt(0.2), 1e-6);
    }
  }
  EXPECT_NEAR(nearest, 0.2 * std::sqrt(2.0) / 4.0, 1e-6);  // a quarter of |b - a| times the reach
}

TEST(BlendCorners, KeepsEndsTurnsSteadilyAndStaysNearThePath) {
  std::mt19937_64 random(5);
  for (int trial = 0; trial < 30; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Trajectory path = random_polyline(2 + trial % 7, 2 + trial % 6, random);
    const double reach = 0.05 * (1 + trial % 5);
    const auto blended = blend_corners(path, reach);
    ASSERT_TRUE(blended) << blended.error().describe();
    ASSERT_TRUE(blended->validate());
    EXPECT_TRUE(std::ranges::equal(blended->q(0), path.q(0)));
    EXPECT_TRUE(std::ranges::equal(blended->q(blended->size() - 1), path.q(path.size() - 1)));
    const std::vector<Sample> all = samples(*blended, 20000);
    for (std::size_t i = 1; i + 1 < all.size(); ++i) {
      EXPECT_LE(distance_to(path, all[i].q), 0.5 * reach + 1e-12);  // |b - a| <= 2
      if (i < 400 || i + 400 > all.size()) continue;                // from rest, and to it
      EXPECT_GT(all[i].qdot.normalized().dot(all[i + 1].qdot.normalized()), 0.99);
      EXPECT_LT(all[i].qdot.norm(), 1.0 + 1e-9);
    }
  }
}

TEST(BlendCorners, HalvesOfShortLinesAreWhatCornersGet) {
  const Trajectory path = path_through(
      {Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 0), Eigen::Vector2d(1, 1), Eigen::Vector2d(2, 1)});
  const auto blended = blend_corners(path, 10.0);
  ASSERT_TRUE(blended) << blended.error().describe();
  // Both parabolas meet in the middle of the line between them, and in that of the first and last.
  const std::vector<double> expected{0.0, 0.0, 0.5, 0.0, 1.0, 0.5, 1.5, 1.0, 2.0, 1.0};
  ASSERT_EQ(blended->positions.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_NEAR(blended->positions[i], expected[i], 1e-15);
  }
}

TEST(BlendCorners, AreFollowedWithoutAStop) {
  std::mt19937_64 random(11);
  for (int trial = 0; trial < 20; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    const Trajectory path = random_polyline(7, 3 + trial % 4, random);
    const MotionLimits limits{std::vector<double>(7, 2.0), std::vector<double>(7, 5.0), {}};
    const auto blended = blend_corners(path, 0.4);
    ASSERT_TRUE(blended) << blended.error().describe();
    const auto timed = retime(*blended, limits, {.stop_at_goal = true});
    const auto stopping = retime(path, limits, {.stop_at_goal = true});
    ASSERT_TRUE(timed) << timed.error().describe();
    ASSERT_TRUE(stopping) << stopping.error().describe();
    EXPECT_LT(timed->trajectory.duration_s(), stopping->trajectory.duration_s());
    for (int i = 1; i + 1 < timed->trajectory.size(); ++i) {
      const auto qdot = timed->trajectory.qdot(i);
      EXPECT_TRUE(std::ranges::any_of(qdot, [](double v) { return std::abs(v) > 1e-3; }));
    }
  }
}

TEST(BlendCorners, APathThatTurnsBackStopsThereAlone) {
  const Trajectory path =
      path_through({Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 0)});
  const auto blended = blend_corners(path, 0.2);
  ASSERT_TRUE(blended) << blended.error().describe();
  const auto timed = retime(*blended, {{1.0, 1.0}, {1.0, 1.0}, {}}, {.stop_at_goal = true});
  ASSERT_TRUE(timed) << timed.error().describe();
  double farthest = 0.0;
  for (const Sample& sample : samples(timed->trajectory, 1000)) {
    farthest = std::max(farthest, sample.q.x());
  }
  EXPECT_NEAR(farthest, 0.9, 1e-3);  // the middle of a parabola that is folded onto its line
}

TEST(BlendCorners, RefusesWhatHasNoCorners) {
  const Trajectory path =
      path_through({Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 0), Eigen::Vector2d(1, 2)});
  Trajectory moves = path;
  moves.qdot(1)[0] = 0.1;
  Trajectory stays = path;
  std::ranges::copy(stays.q(0), stays.q(1).begin());
  Trajectory broken = path;
  broken.positions[2] = std::nan("");
  const auto why = [](const Result<Trajectory>& result) {
    return result ? std::string("accepted") : result.error().describe();
  };
  EXPECT_NE(why(blend_corners(moves, 0.2)).find("state 1 of the path moves"), std::string::npos);
  EXPECT_NE(why(blend_corners(stays, 0.2)).find("states 0 and 1"), std::string::npos);
  EXPECT_NE(why(blend_corners(broken, 0.2)).find("state 1"), std::string::npos);
  EXPECT_NE(why(blend_corners(make_trajectory(2, 1, 1.0), 0.2)).find("fewer than two"),
            std::string::npos);
  for (const double reach : {0.0, -1.0, std::nan("")}) {
    EXPECT_NE(why(blend_corners(path, reach)).find("must be positive"), std::string::npos);
  }
}

}  // namespace
}  // namespace sidestep
