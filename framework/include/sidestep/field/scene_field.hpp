#pragma once

#include <memory>
#include <vector>

#include <Eigen/Geometry>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/geometry/scene.hpp>

namespace sidestep {

namespace detail {
struct Solid;
}

/// The exact distance to the shapes of a scene as they stand at one time: nothing is cut into
/// voxels, nothing interpolated. Everything within its bounds is known. Of overlapping shapes, the
/// deepest counts inside. Where two are equally near, the gradient is one of theirs; in the middle
/// of one, one of the shortest ways out.
class SIDESTEP_EXPORT SceneField final : public DistanceField {
 public:
  /// `bounds_m` become whole millimetres.
  SceneField(const Scene& scene, Stamp time, const Eigen::AlignedBox3d& bounds_m);
  ~SceneField() override;

  void query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
             std::span<Eigen::Vector3d> gradients,
             std::span<FieldStatus> statuses) const noexcept override;
  std::size_t query_below(std::span<const PointLanes> points_m, std::span<const double> limits_m,
                          bool also_unknown,
                          std::span<FieldSample> samples) const noexcept override;

 private:
  struct Nearest;
  void find_nearest(const PointLanes& points_m, double limit_m, Nearest& nearest) const noexcept;
  [[nodiscard]] FieldSample sample(const Nearest& nearest, std::size_t lane) const noexcept;

  std::vector<detail::Solid> solids_;  ///< Meshes last.
  std::size_t plain_ = 0;              ///< Those before the meshes.
};

}  // namespace sidestep
