#include "sines.hpp"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace sidestep::detail {
namespace {

void expect_exact(const double (&angles)[kAngles]) {
  double sines[kAngles], cosines[kAngles];
  sines_and_cosines(angles, sines, cosines);
  for (int i = 0; i < kAngles; ++i) {
    const auto angle = static_cast<long double>(angles[i]);
    EXPECT_NEAR(sines[i], static_cast<double>(std::sin(angle)), 3e-16) << angles[i];
    EXPECT_NEAR(cosines[i], static_cast<double>(std::cos(angle)), 3e-16) << angles[i];
  }
}

TEST(Sines, AreThoseOfExtendedPrecision) {
  std::mt19937 generator(3);
  for (const double range : {1.0, 7.0, 100.0, 1e5, 1e9}) {
    std::uniform_real_distribution<double> uniform(-range, range);
    for (int i = 0; i < 2000; ++i) {
      double angles[kAngles];
      for (double& angle : angles) angle = uniform(generator);
      expect_exact(angles);
    }
  }
  constexpr double kPi = 3.14159265358979323846;
  expect_exact({0.0, -0.0, kPi, -kPi, kPi / 2.0, -kPi / 4.0, 2.0 * kPi, 1e-300});
}

TEST(Sines, OfWhatIsNoNumberAreNone) {
  const double infinity = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  double sines[kAngles], cosines[kAngles];
  sines_and_cosines({nan, infinity, -infinity, 0.5, nan, 1.0, 2.0, 3.0}, sines, cosines);
  for (const int i : {0, 1, 2, 4}) {
    EXPECT_TRUE(std::isnan(sines[i]) && std::isnan(cosines[i])) << i;
  }
  EXPECT_NEAR(sines[3], std::sin(0.5), 3e-16);
}

}  // namespace
}  // namespace sidestep::detail
