#include "flat_points.hpp"

#include <gtest/gtest.h>

#include <random>

namespace sidestep::joint_paths {
namespace {

TEST(FlatPoints, FindsTheNearestOfThoseThatAreLeft) {
  constexpr std::size_t kDof = 7;
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  FlatPoints points(kDof);
  std::vector<std::vector<double>> all;
  const auto any = [&] {
    std::vector<double> point(kDof);
    for (double& value : point) value = unit(random);
    return point;
  };
  const auto square = [](const std::vector<double>& a, const std::vector<double>& b) {
    double sum = 0.0;
    for (std::size_t j = 0; j < kDof; ++j) sum += (a[j] - b[j]) * (a[j] - b[j]);
    return sum;
  };
  for (int i = 0; i < 3000; ++i) {
    if (all.size() > 1 && i % 3 == 2) {
      const std::size_t gone = random() % all.size();
      all[gone] = all.back();
      all.pop_back();
      points.remove(gone);
    } else {
      all.push_back(any());
      points.add(all.back().data());
    }
    ASSERT_EQ(points.size(), all.size());
    const std::vector<double> wanted = any();
    const std::size_t found = points.nearest(wanted.data());
    ASSERT_LT(found, all.size());
    double least = 1e9;
    for (const auto& point : all) least = std::min(least, square(point, wanted));
    EXPECT_NEAR(square(all[found], wanted), least, 1e-12);
  }
  points.clear();
  EXPECT_EQ(points.size(), 0u);
}

}  // namespace
}  // namespace sidestep::joint_paths
