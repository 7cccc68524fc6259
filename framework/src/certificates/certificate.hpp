#pragma once

#include <sidestep/certificates/certify.hpp>

namespace sidestep {

/// What a robot keeps apart from.
struct CertifiedObject {
  std::string name;
  Body body;
  Transform T_world_body = Transform::Identity();
  std::vector<int> may_touch;  ///< Links that are not held against it.
};

/// A certificate of a robot, its shapes, objects and a motion (docs/reference/certificates.md).
/// `claims`: as JSON, without brackets.
[[nodiscard]] std::string certificate_text(const KinematicTree& robot,
                                           const std::vector<Body>& shapes,
                                           const std::vector<CertifiedObject>& objects,
                                           const PolynomialMotion& motion, double margin_m,
                                           const std::string& claims);

}  // namespace sidestep
