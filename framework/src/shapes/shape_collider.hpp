#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/planning/shape_obstacles.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// The robot's shapes and the obstacles as FCL sees them: everything that needs FCL. Immutable;
/// what moves lives in a Pose, one per check.
class ShapeCollider {
 public:
  /// Arguments have been validated.
  ShapeCollider(const RobotDescription& robot, const ShapeObstacles& obstacles,
                const std::vector<AllowedContact>& allowed);
  ~ShapeCollider();
  ShapeCollider(const ShapeCollider&) = delete;
  ShapeCollider& operator=(const ShapeCollider&) = delete;

  /// Robot and moving objects at one instant.
  class Pose;
  struct PoseDeleter {
    void operator()(Pose* pose) const noexcept;
  };
  using PosePtr = std::unique_ptr<Pose, PoseDeleter>;
  [[nodiscard]] PosePtr make_pose() const;
  void place(Pose& pose, std::span<const Transform> T_world_link, double scene_time_s) const;

  [[nodiscard]] int shape_count() const noexcept;
  [[nodiscard]] int pair_count() const noexcept;
  /// The two links of a pair that are checked against each other, each with shapes.
  [[nodiscard]] std::pair<int, int> pair_links(int pair) const noexcept;

  struct Proximity {
    double clearance_m = 0.0;  ///< Negative: minus the depth of the deepest contact.
    std::string other;         ///< What is nearest; empty if nothing is nearer than asked for.
  };
  /// A shape against all obstacles, if it is nearer to one than `bound_m`.
  [[nodiscard]] Proximity to_obstacles(int shape, const Pose& pose, double bound_m) const;
  /// The clearance alone, up to 5e-5 m too large, and 0 where they overlap: sooner told.
  [[nodiscard]] double gap_to_obstacles_m(int shape, const Pose& pose, double bound_m) const;
  [[nodiscard]] double gap_between_pair_m(int pair, const Pose& pose, double bound_m) const;
  /// The shapes of the two links of a pair, if any are nearer than `bound_m`.
  [[nodiscard]] double between_pair(int pair, const Pose& pose, double bound_m) const;

 private:
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

}  // namespace sidestep
