#pragma once

#include <vector>

#include "rigid_body.hpp"

namespace sidestep {

/// How well spheres cover shapes. Shares are 1 without shapes.
struct Cover {
  int spheres = 0;
  double surface_share = 1.0;  ///< Of the shapes' surface, what lies within spheres.
  double volume_share = 1.0;   ///< Of the shapes' volume.
  double gap_m = 0.0;          ///< How far the shapes stand out from the spheres at most.
  double protrusion_m = 0.0;   ///< How far spheres stand out from the shapes at most.
  double shapes_m3 = 0.0;      ///< Volume of the shapes' union.
  double spheres_m3 = 0.0;     ///< Volume of the spheres' union.
  double excess_m3 = 0.0;      ///< Of the spheres' union, what lies outside of the shapes.
};

struct LinkCover {
  int link = 0;
  Cover cover;
};
struct RobotCover {
  std::vector<LinkCover> links;  ///< Those with shapes or spheres, ascending.
  Cover whole;                   ///< Volumes are sums over bodies that move against each other.
};

/// Samples how well spheres cover a robot's shapes; the same for the same input. A link's shapes
/// may be covered by spheres of any link of its body; its excess is what its own spheres have
/// outside of all the body's shapes. Shares and volumes are good to 1 %, gap and protrusion to 1 %
/// of the radius. Milliseconds a link. [any]; allocates.
[[nodiscard]] RobotCover measure_cover(const std::vector<RigidBody>& bodies,
                                       const std::vector<CollisionSphere>& spheres);

}  // namespace sidestep
