#include "sines.hpp"

#include <cmath>

#include "sine_lanes.hpp"

namespace sidestep::detail {
namespace {

static_assert(kAngles == kLanes);

SIDESTEP_SIMD_CLONES
void evaluate(const double* angles, double* sines, double* cosines) noexcept {
  sine_lanes(lanes(angles), lanes(sines), lanes(cosines));
}

}  // namespace

void sines_and_cosines(const double (&angles)[kAngles], double (&sines)[kAngles],
                       double (&cosines)[kAngles]) noexcept {
  evaluate(angles, sines, cosines);
  for (int i = 0; i < kAngles; ++i) {
    if (std::abs(angles[i]) <= kLargestAngle) continue;
    sines[i] = std::sin(angles[i]);
    cosines[i] = std::cos(angles[i]);
  }
}

}  // namespace sidestep::detail
