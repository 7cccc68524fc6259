#pragma once

#include <span>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/geometry/transform.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// The joints that move the whole of a robot in the plane: two prismatic ones along the world's x
/// and y, and one that turns it about z. Immutable. [any]
class SIDESTEP_EXPORT BaseJoints {
 public:
  /// Fails with kUnsupported where no three joints move all that has a shape as one.
  [[nodiscard]] static Result<BaseJoints> of(const RobotModel& robot);

  /// Joint positions of the same robot in another frame, of which T_new_old has a rotation about z
  /// alone and no z. q: one row.
  void move(const Transform& T_new_old, std::span<double> q) const noexcept;
  /// The same for joint velocities.
  void turn(const Transform& T_new_old, std::span<double> qdot) const noexcept;

  [[nodiscard]] int x() const noexcept { return x_; }
  [[nodiscard]] int y() const noexcept { return y_; }
  [[nodiscard]] int yaw() const noexcept { return yaw_; }

 private:
  BaseJoints(int x, int y, int yaw) : x_(x), y_(y), yaw_(yaw) {}

  int x_, y_, yaw_;
};

/// The rotation about z of a transform that has no other.
[[nodiscard]] SIDESTEP_EXPORT double yaw_of(const Transform& transform) noexcept;

}  // namespace sidestep
