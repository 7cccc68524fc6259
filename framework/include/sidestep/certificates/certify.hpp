#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/certificates/body.hpp>
#include <sidestep/certificates/polynomial_motion.hpp>
#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/planning/shape_obstacles.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {

/// What a robot is to keep apart from: a scene that stands still, and swarms in it.
struct CertifiedScene {
  Scene scene;
  std::vector<Swarm> swarms;
  std::vector<AllowedContact> allowed;  ///< Links that are not held against an object.
};

/// An instant at which two things are nearer than the margin, or overlap: a point of each, in the
/// world.
struct Witness {
  double time_s = 0.0;
  std::string a, b;  ///< A link, and a link or an object.
  Eigen::Vector3d p_a = Eigen::Vector3d::Zero();
  Eigen::Vector3d p_b = Eigen::Vector3d::Zero();
  double distance_m = 0.0;  ///< Between the points; 0 where the two overlap.
};

/// What could not be told.
struct Undecided {
  std::string a, b;
  double from_s = 0.0;
  double to_s = 0.0;
};

struct CertifySettings {
  double margin_m = 0.0;    ///< All that is not left out is to be more than this apart.
  int most_parts = 100000;  ///< Looked at for one pair of shapes; then it is undecided.
  bool wants_certificate = false;
};

struct Certification {
  enum class Outcome { kProven, kRefuted, kUndecided };
  Outcome outcome = Outcome::kUndecided;
  std::optional<Witness> witness;    ///< Of a refuted motion, if it is not a limit that it breaks.
  std::string broken_limit;          ///< The limit that a refuted motion breaks.
  std::vector<Undecided> undecided;  ///< The first of each pair of shapes.
  /// Links and objects of meshes that are not closed: they have no inside, where others might be.
  std::vector<std::string> surfaces;
  std::string certificate;  ///< Of a proven motion, if wanted.
  std::size_t pairs = 0;    ///< Of shapes that were looked at.
  std::size_t parts = 0;    ///< Of the certificate.
};

/// Proves over continuous time that a robot's collision shapes keep apart from those of a scene
/// that stands still, and from each other (RobotDescription::self_collision_pairs), and that joints
/// keep their limits; or refutes it at an instant. Of a mesh its triangles are held against
/// others, and, where it is closed, what starts inside is in it. What no joint moves is not held
/// against the scene.
///
/// Each pair is shown apart in parts of the motion: at the middle of a part, along a direction, the
/// two are apart by more than either moves within the part. A direction is all that anyone needs to
/// see it again. Of meshes and swarms halves of halves are shown apart.
///
/// Fails with kInvalidArgument for a robot without collision shapes, an object that moves, and a
/// motion that is not the robot's. [any]; allocates.
[[nodiscard]] SIDESTEP_EXPORT Result<Certification> certify(const KinematicTree& robot,
                                                            const CertifiedScene& scene,
                                                            const PolynomialMotion& motion,
                                                            const CertifySettings& settings);

/// "proven", "refuted" or "undecided".
[[nodiscard]] SIDESTEP_EXPORT std::string_view name_of(Certification::Outcome outcome) noexcept;

}  // namespace sidestep
