#pragma once

#include "certify.hpp"

namespace sidestep {

/// A certificate of a robot, a scene and a motion (docs/reference/certificates.md), without claims.
[[nodiscard]] nlohmann::ordered_json claimed(const KinematicTree& robot, const Scene& scene,
                                             const PolynomialMotion& motion, double margin_m);

}  // namespace sidestep
