#pragma once

#include <memory>
#include <optional>
#include <span>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

#include "options.hpp"

namespace sidestep::simulator {

/// A camera's direction of view, as the head turns it: along `T_link_camera`'s z in `link`.
struct Eye {
  int link = 0;
  Transform T_link_camera = Transform::Identity();
};

/// A pan and a tilt joint that the robot's planned joints know nothing of, between the body and a
/// camera. Turns at limited speed within limits.
class Head {
 public:
  /// Fails with kConfig where the robot has no such joints, they are planned, or do not carry the
  /// eye one after the other; with kUnsupported where the robot does not tell its joints.
  [[nodiscard]] static Result<Head> create(std::shared_ptr<const RobotModel> robot,
                                           const HeadOptions& options, const Eye& eye);

  /// Places the links that the head carries; all poses are those of the robot with its head as the
  /// profile has it.
  void turn(std::span<Transform> T_world_link) const;

  /// Turns towards a point until `stamp`; the time since the last call is what it has for that.
  void look_at(const Eigen::Vector3d& p_world, std::span<const Transform> T_world_link,
               Stamp stamp);
  /// Pans towards a direction, tilted as it is.
  void look_along(const Eigen::Vector3d& direction_world, std::span<const Transform> T_world_link,
                  Stamp stamp);
  /// Stays as it is until `stamp`.
  void rest(Stamp stamp) { turned_at_ = stamp; }

  [[nodiscard]] double pan_rad() const noexcept { return pan_.angle_rad; }
  [[nodiscard]] double tilt_rad() const noexcept { return tilt_.angle_rad; }

 private:
  struct Axis {
    int link = 0;  ///< That it moves.
    double lower_rad = 0.0;
    double upper_rad = 0.0;
    double angle_rad = 0.0;
  };

  Head(std::shared_ptr<const RobotModel> robot, const KinematicTree& tree, const Eye& eye)
      : robot_(std::move(robot)), tree_(&tree), eye_(eye) {}

  [[nodiscard]] Result<Axis> find_axis(const std::string& joint, double lower_rad,
                                       double upper_rad) const;
  [[nodiscard]] bool carries(int link, int carried) const;
  void place(double pan_rad, double tilt_rad, std::span<Transform> T_world_link) const;
  [[nodiscard]] Transform eye_pose(double pan_rad, double tilt_rad,
                                   std::span<const Transform> T_world_link,
                                   Eigen::Vector3d& pan_axis, Eigen::Vector3d& tilt_axis) const;
  void turn_towards(double pan_rad, double tilt_rad, Stamp stamp);

  std::shared_ptr<const RobotModel> robot_;  // keeps tree_ alive
  const KinematicTree* tree_;
  Eye eye_;
  Axis pan_;
  Axis tilt_;
  double speed_radps_ = 0.0;
  std::optional<Stamp> turned_at_;
};

}  // namespace sidestep::simulator
