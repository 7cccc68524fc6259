#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <sidestep/geometry/shape.hpp>

namespace sidestep {

using Triangle = std::array<Eigen::Vector3d, 3>;

/// Distance to the triangles signed by the generalised winding number, visiting all of them.
/// Infinity for a mesh without triangles.
[[nodiscard]] double brute_force_signed_distance_m(const Mesh& mesh, const Eigen::Vector3d& p);

/// A tree of bounding boxes over a mesh's triangles: distances by branch and bound, winding
/// numbers by adding up distant branches as dipoles (Barill et al. 2018, "Fast winding numbers
/// for soups and clouds"). The distance is exact; the winding number is approximate, which
/// decides only its sign.
class MeshIndex {
 public:
  explicit MeshIndex(const Mesh& mesh);

  [[nodiscard]] double signed_distance_m(const Eigen::Vector3d& p) const;
  [[nodiscard]] double winding_number(const Eigen::Vector3d& p) const;

 private:
  struct Branch {
    Eigen::AlignedBox3d bounds;
    Eigen::Vector3d area_centre = Eigen::Vector3d::Zero();  ///< Weighted by area.
    Eigen::Vector3d area_normal = Eigen::Vector3d::Zero();  ///< Sum of normals times areas.
    double radius_m = 0.0;                                  ///< Around area_centre.
    std::int32_t begin = 0;                                 ///< Triangles, in triangles_' order.
    std::int32_t end = 0;
    std::int32_t right = -1;  ///< The left child follows its parent; -1 for a leaf.
  };

  std::int32_t build(std::int32_t begin, std::int32_t end);

  std::vector<Triangle> triangles_;
  std::vector<Branch> branches_;
};

}  // namespace sidestep
