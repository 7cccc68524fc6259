#include "shorten.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace sidestep::rrt_connect {
namespace {

/// A plane with a disc in its middle: a motion is clear that keeps farther from it than its radius.
class AroundADisc final : public joint_paths::Checker {
 public:
  Result<void> look_at(const Problem&) override { return {}; }
  bool is_clear(std::span<const double> q) override { return is_clear(q, q, 0.0); }
  unsigned find_blocked(std::span<const double> q) override {
    return is_clear(q.first(2)) ? 0u : 1u;
  }
  bool is_clear(std::span<const double> a, std::span<const double> b, double) override {
    const double x = b[0] - a[0], y = b[1] - a[1], squares = x * x + y * y;
    const double t = squares > 0.0 ? std::clamp(-(a[0] * x + a[1] * y) / squares, 0.0, 1.0) : 0.0;
    return std::hypot(a[0] + t * x, a[1] + t * y) > kRadius;
  }
  std::optional<Violation> violation(std::span<const double>) override { return std::nullopt; }

  static constexpr double kRadius = 1.0;
};

bool is_clear(const std::vector<double>& path) {
  AroundADisc disc;
  for (std::size_t i = 2; i < path.size(); i += 2) {
    const std::span<const double> edge = std::span(path).subspan(i - 2, 4);
    if (!disc.is_clear(edge.first(2), edge.last(2), 0.0)) return false;
  }
  return true;
}

/// The shortest way around: two tangents and the arc between them.
double shortest(double from_centre) {
  const double tangent = std::sqrt(from_centre * from_centre - 1.0);
  return 2.0 * tangent + (M_PI - 2.0 * std::acos(1.0 / from_centre));
}

TEST(Shorten, ComesNearTheShortestWayAndKeepsItClear) {
  std::vector<double> detour;
  for (int i = 0; i <= 60; ++i) {  // far around, in a zigzag
    const double angle = M_PI * (1.0 - i / 60.0);
    const double reach = i == 0 || i == 60 ? 2.0 : i % 2 == 0 ? 3.0 : 4.0;
    detour.insert(detour.end(), {reach * std::cos(angle), reach * std::sin(angle)});
  }
  ASSERT_TRUE(is_clear(detour));
  const std::vector<double> ends{detour[0], detour[1], detour[120], detour[121]};
  const Shortening how{{1.0, 1.0}, 0.005, 300};
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    std::vector<double> path = detour;
    AroundADisc disc;
    shorten(path, how, disc, seed, Deadline());
    EXPECT_TRUE(is_clear(path));
    EXPECT_EQ(std::vector<double>(path.begin(), path.begin() + 2),
              std::vector<double>(ends.begin(), ends.begin() + 2));
    EXPECT_EQ(std::vector<double>(path.end() - 2, path.end()),
              std::vector<double>(ends.begin() + 2, ends.end()));
    const double length = path_length(path, how.weights);
    EXPECT_GE(length, shortest(2.0) - 1e-9);
    EXPECT_LE(length, 1.05 * shortest(2.0));
  }
}

TEST(Shorten, LeavesOutVerticesThatAreNotNeeded) {
  std::vector<double> path;
  for (int i = 0; i <= 10; ++i) path.insert(path.end(), {-5.0 + i, 2.0});
  AroundADisc disc;
  shorten(path, {{1.0, 1.0}, 0.005, 0}, disc, 1, Deadline());
  EXPECT_EQ(path, (std::vector<double>{-5.0, 2.0, 5.0, 2.0}));
}

/// A joint that weighs nothing may go as it will; lengths count the others.
TEST(Shorten, MeasuresLengthsWithWeights) {
  const std::vector<double> path{0.0, 0.0, 3.0, 4.0, 3.0, 8.0};
  EXPECT_DOUBLE_EQ(path_length(path, std::vector<double>{1.0, 1.0}), 9.0);
  EXPECT_DOUBLE_EQ(path_length(path, std::vector<double>{2.0, 0.0}), 6.0);
}

}  // namespace
}  // namespace sidestep::rrt_connect
