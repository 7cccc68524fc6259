#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/robot/kinematic_tree.hpp>

#include "sphere_cover.hpp"

namespace sidestep {

/// How far a robot may stand out from its profile's shapes and spheres, provably.
inline constexpr double kMostStandingOut_m = 0.005;
/// How far links may be from where the profile has them.
inline constexpr double kMostOffset_m = 0.001;
inline constexpr double kMostTurn_rad = 0.001;

/// How far a link is from where the profile has it, in the worst configuration.
struct LinkOffset {
  std::string link;
  double offset_m = 0.0;
  double turn_rad = 0.0;

  [[nodiscard]] bool is_small() const noexcept {
    return offset_m <= kMostOffset_m && turn_rad <= kMostTurn_rad;
  }
};

/// A link's collision shapes against those of the profile's that move with it; points are in the
/// link's frame.
struct LinkAgainst {
  std::string link;
  std::string with;  ///< The profile's link: the same, or the nearest that moves with it.
  std::optional<StandingOut> shapes;  ///< Nothing where the profile has spheres alone.
  StandingOut spheres;
};

/// A profile held against a URDF of the same robot.
struct UrdfComparison {
  int configurations = 0;
  std::vector<LinkOffset> offsets;    ///< Of the links that both have.
  std::vector<LinkAgainst> links;     ///< Empty where one of the offsets is not small.
  std::vector<std::string> findings;  ///< Why the profile is not to be relied on; empty if it is.
  std::vector<std::string> notes;     ///< What the comparison takes for granted.
  int bare_links = 0;                 ///< With visual shapes alone, which are not compared.
};

/// What of the URDF's collision shapes lies outside of the profile's shapes and spheres, and
/// whether the profile moves as the URDF does. package_paths: where package:// is looked for. Fails
/// where the URDF or one of its meshes cannot be read. Seconds. [any]; allocates.
[[nodiscard]] Result<UrdfComparison> compare_with_urdf(
    const KinematicTree& robot, const std::filesystem::path& urdf,
    const std::vector<std::string>& package_paths);

}  // namespace sidestep
