#pragma once

#include <functional>
#include <limits>
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

/// What of a surface lies outside of something.
struct StandingOut {
  double surface_m2 = 0.0;
  double outside_m2 = 0.0;
  double farthest_m = 0.0;  ///< 0 where nothing does; infinite where there is nothing to lie in.
  double at_most_m = 0.0;   ///< No point of the surface is farther out, looked at or not.
  Eigen::Vector3d p_farthest = Eigen::Vector3d::Zero();  ///< Where farthest_m is; else unspecified.
};

/// The signed distance of points from what a surface should lie in; infinite where that is nothing.
using DistanceTo = std::function<double(const Eigen::Vector3d&)>;

/// How fine surfaces are looked at: no point of one is farther than this from a point at which the
/// distance was taken, or than kSurfaceShare of that distance, where it may matter. As distances
/// grow no faster than the way, `farthest_m` is too small by no more.
inline constexpr double kSurfaceFineness_m = 9e-4;
inline constexpr double kSurfaceShare = 0.02;
/// Likewise, where it decides whether a limit is kept.
inline constexpr double kProofFineness_m = 2e-4;

/// Looks at the corners of all triangles and at ever smaller parts of them, finer where that may
/// prove that nothing stands out by more than limit_m. The same for the same input. [any];
/// allocates.
[[nodiscard]] StandingOut standing_out(const Mesh& surface, const DistanceTo& distance_m,
                                       double limit_m = std::numeric_limits<double>::infinity());

/// Of round shapes.
inline constexpr double kFacetError_m = 1e-4;
/// Triangles of a bounded shape that lie no farther than its facet_error_m() inside of it. [any];
/// allocates.
[[nodiscard]] Mesh surface_of(const Shape& shape);
[[nodiscard]] double facet_error_m(const Shape& shape);

}  // namespace sidestep
