#ifndef SIDESTEP_KERNELS
#include "sines.hpp"

#include <cmath>

#include "sine_lanes.hpp"

#define SIDESTEP_KERNELS "sines.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep::detail {

static_assert(kAngles == kLanes);

void sines_and_cosines(const double (&angles)[kAngles], double (&sines)[kAngles],
                       double (&cosines)[kAngles]) noexcept {
  SIDESTEP_DISPATCH(evaluate)(angles, sines, cosines);
  for (int i = 0; i < kAngles; ++i) {
    if (std::abs(angles[i]) <= kLargestAngle) continue;
    sines[i] = std::sin(angles[i]);
    cosines[i] = std::cos(angles[i]);
  }
}

}  // namespace sidestep::detail

#else

namespace {

void evaluate(const double* angles, double* sines, double* cosines) noexcept {
  detail::sine_lanes(lanes(angles), lanes(sines), lanes(cosines));
}

}  // namespace

#endif
