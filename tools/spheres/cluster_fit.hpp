#pragma once

#include <cstddef>
#include <span>
#include <stop_token>
#include <utility>
#include <vector>

#include "rigid_body.hpp"

namespace sidestep {

/// A box of a shape's, along the axes of the shape's frame, that holds some of the shape.
struct Cell {
  int part = 0;  ///< Index into RigidBody::parts.
  Eigen::Vector3d p_shape = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_m = Eigen::Vector3d::Zero();
};

/// What of a body is held already, when spheres for one of its links are looked for.
struct Held {
  std::vector<BodySphere> spheres;
  std::vector<int> links;  ///< Whose shapes are held completely.
};

/// A link's shapes as boxes that hold all of them: fine at the surface, coarse in the depth.
/// Spheres that hold every box hold the shapes, not only at samples. Left out are boxes that are
/// held already. Halved until their half diagonal is at most `fine_m`, deeper ones some of the
/// depth; at most `most` boxes, and coarser where that is too few. [any]; allocates.
[[nodiscard]] std::vector<Cell> link_cells(const RigidBody& body, int link, const Held& held,
                                           double fine_m, std::size_t most);

/// From a point to the farthest corner of a box; the point in the shape's frame.
[[nodiscard]] inline double farthest_m(const Cell& cell, const Eigen::Vector3d& p_shape) noexcept {
  return ((p_shape - cell.p_shape).cwiseAbs() + cell.half_m).norm();
}

/// How large a sphere must be to hold what of the shapes lies in these boxes: as the farthest
/// corner says, or less, since boxes at curved surfaces are halved further where that helps.
/// [any]; allocates.
[[nodiscard]] double radius_to_hold_m(const RigidBody& body, std::span<const Cell> cells,
                                      const Eigen::Vector3d& p_body);

/// Covers a link's shapes with spheres that stand out from the shapes of its body as little as
/// their number allows. The shapes' boxes are clustered by the sphere that would have to grow the
/// least to hold them, each sphere moves to where it holds its cluster best (Lloyd's iteration on a
/// set of spheres, Wang et al. 2006), and the worst one is divided. Every box lies in the sphere of
/// its cluster, so that the cover is always complete. The same for the same input. [any]
class ClusterFit {
 public:
  struct Settings {
    double protrusion_m = 0.0;  ///< What is aimed at; within it, the least excess.
    double fine_m = 0.0;        ///< Half diagonal of boxes at the surface.
  };

  /// With one sphere, and those of the shapes that are spheres themselves.
  ClusterFit(const RigidBody& body, int link, const Held& held, const Settings& settings);

  [[nodiscard]] int spheres() const noexcept {
    return static_cast<int>(clusters_.size() + balls_.size());
  }
  /// Divides until all spheres stand out no farther than the settings say, there are
  /// `most_spheres`, or a stop is requested.
  void reach_protrusion(int most_spheres, const std::stop_token& stop);

  /// Centres and radii in the link's frame; multiples of 0.1 mm, but for shapes that are spheres.
  [[nodiscard]] std::vector<CollisionSphere> result() const;

 private:
  struct Cluster {
    Eigen::Vector3d p_body = Eigen::Vector3d::Zero();
    double protrusion_m = 0.0;
    double radius_m = 0.0;  ///< That holds the cells.
    double excess_m3 = 0.0;
    std::vector<Cell> cells;
  };
  using Clusters = std::vector<Cluster>;

  /// A sphere that holds these cells, without them.
  [[nodiscard]] Cluster sphere_at(const Eigen::Vector3d& p_body, std::span<const Cell> cells) const;
  [[nodiscard]] bool is_better(const Cluster& a, const Cluster& b) const noexcept;
  void assign(Clusters& clusters) const;
  void improve(Cluster& cluster) const;
  bool move_by(double step, std::span<const Cell> cells, Cluster& cluster) const;
  void iterate(Clusters& clusters, int rounds) const;
  void tighten(Clusters& clusters) const;
  void divide(Clusters& clusters, std::size_t index) const;
  [[nodiscard]] std::pair<Eigen::Vector3d, Eigen::Vector3d> ends(const Cluster& cluster) const;
  void drop_superfluous(const std::stop_token& stop);
  [[nodiscard]] bool is_close_enough(const Clusters& clusters) const;
  [[nodiscard]] Eigen::Vector3d centre_m(const Cell& cell) const;

  const RigidBody& body_;
  const int link_;
  const double protrusion_m_;
  std::vector<Eigen::Vector3d> directions_;
  std::vector<Cell> cells_;
  std::vector<BodySphere> balls_;  ///< Shapes that are spheres themselves.
  Clusters clusters_;
};

}  // namespace sidestep
