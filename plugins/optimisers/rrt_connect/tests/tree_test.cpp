#include "tree.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace sidestep::rrt_connect {
namespace {

/// By brute force in double precision, at each size from one point on.
TEST(Tree, FindsTheNearestPoint) {
  for (const std::size_t dof : {1u, 7u, 14u}) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> unit(-3.0, 3.0);
    const auto any = [&] {
      std::vector<double> point(dof);
      for (double& value : point) value = unit(random);
      return point;
    };
    const auto distance = [](std::span<const double> a, std::span<const double> b) {
      double squares = 0.0;
      for (std::size_t j = 0; j < a.size(); ++j) squares += (a[j] - b[j]) * (a[j] - b[j]);
      return std::sqrt(squares);
    };
    Tree tree(dof);
    for (std::size_t i = 0; i < 200; ++i) {
      const std::vector<double> point = any();
      ASSERT_EQ(tree.add(point, i == 0 ? Tree::kNone : i / 2), i);
      EXPECT_EQ(tree.parent(i), i == 0 ? Tree::kNone : i / 2);
      EXPECT_TRUE(std::ranges::equal(tree.point(i), point));
      const std::vector<double> wanted = any();
      const Tree::Found found = tree.nearest(wanted);
      ASSERT_LT(found.number, tree.size());
      double least = 1e9;
      for (std::size_t k = 0; k < tree.size(); ++k) {
        least = std::min(least, distance(tree.point(k), wanted));
      }
      EXPECT_NEAR(found.distance, least, 1e-5);
      EXPECT_NEAR(distance(tree.point(found.number), wanted), least, 1e-5);
    }
  }
}

}  // namespace
}  // namespace sidestep::rrt_connect
