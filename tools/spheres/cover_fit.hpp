#pragma once

#include <optional>
#include <stop_token>
#include <vector>

#include "rigid_body.hpp"

namespace sidestep {

/// What a fit aims at.
struct FitGoal {
  static constexpr double kLeastProtrusion_m = 0.002;
  static constexpr double kMostProtrusion_m = 1.0;
  static constexpr int kMostSpheresOnLink = 128;
  static constexpr int kMostSpheres = 1000;

  double protrusion_m = 0.04;       ///< How far spheres may stand out from the shapes.
  std::optional<int> most_spheres;  ///< Instead: as close as this many spheres come.
  std::optional<int> link;          ///< This link alone; all else stays as it is.
};

/// Covers the robot's shapes completely. Spheres are on the links whose shapes they cover, in order
/// of the links; what spheres of another link of the same body hold needs none of its own. Where
/// `most_spheres` are fewer than there are links with shapes, there is one for each of these all
/// the same. A link that needs more than kMostSpheresOnLink gets these, which then stand out
/// farther. `now`: what is there before. After a stop has been requested, the cover is complete but
/// coarser than was aimed at. Tenths of a second to some seconds a robot.
/// [any]; allocates.
[[nodiscard]] std::vector<CollisionSphere> fit_cover(const std::vector<RigidBody>& bodies,
                                                     const std::vector<CollisionSphere>& now,
                                                     const FitGoal& goal,
                                                     const std::stop_token& stop = {});

}  // namespace sidestep
