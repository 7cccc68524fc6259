#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/geometry/scene.hpp>

namespace sidestep {

namespace detail {
struct Solid;
struct SolidBounds;
}  // namespace detail

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
  std::size_t query_below(std::span<const PointFloats> points_m, std::span<const double> limits_m,
                          bool also_unknown,
                          std::span<FieldSample> samples) const noexcept override;

  /// The scene, standing still as it was at the field's time.
  [[nodiscard]] const std::shared_ptr<const Scene>& scene() const noexcept { return scene_; }

  /// Numbers of all shapes, for find_within().
  [[nodiscard]] std::span<const std::uint32_t> shapes() const noexcept { return numbers_; }

  /// Of the shapes with these numbers, in the order of shapes(), those that come nearer to any of
  /// kLanes finite points than its limit (limits_m: kLanes, positive), within the field's bounds or
  /// not: their numbers into `near`, which has room for all that are asked about. is_near[lane] of
  /// kLanes becomes 1 where any shape is near, and is left alone elsewhere. What a check that knows
  /// of no distances wants, first for the whole of a link and then, among what was found, for its
  /// parts. Returns how many. Does not allocate.
  std::size_t find_within(std::span<const std::uint32_t> shapes, const PointLanes& points_m,
                          const double* limits_m, std::uint32_t* near,
                          double* is_near) const noexcept;

 private:
  struct Nearest;
  void find_nearest(const PointLanes& points_m, double limit_m, Nearest& nearest) const noexcept;
  [[nodiscard]] FieldSample sample(const Nearest& nearest, std::size_t lane) const noexcept;

  std::shared_ptr<const Scene> scene_;
  std::vector<detail::Solid> solids_;        ///< Meshes last.
  std::size_t plain_ = 0;                    ///< Those before the meshes.
  std::vector<detail::SolidBounds> bounds_;  ///< Of those.
  std::vector<std::uint32_t> numbers_;
};

}  // namespace sidestep
