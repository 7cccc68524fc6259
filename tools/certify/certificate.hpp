#pragma once

#include "certify.hpp"

namespace sidestep {

/// What a robot keeps apart from.
struct CertifiedObject {
  std::string name;
  Body body;
  Transform T_world_body = Transform::Identity();
};

/// A certificate of a robot, its shapes, objects and a motion (docs/reference/certificates.md),
/// without claims.
[[nodiscard]] nlohmann::ordered_json claimed(const KinematicTree& robot,
                                             const std::vector<Body>& shapes,
                                             const std::vector<CertifiedObject>& objects,
                                             const PolynomialMotion& motion, double margin_m);

}  // namespace sidestep
