#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/geometry/transform.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {

/// Positions of a head's two joints.
struct HeadAngles {
  double pan_rad = 0.0;
  double tilt_rad = 0.0;
};

/// Kinematics of a robot's head (RobotDescription::head). The robot's own kinematics have it at
/// rest: poses of links that are passed in are those. Immutable. [any]
class SIDESTEP_EXPORT Head {
 public:
  /// Fails with kUnsupported where the robot has no head, or does not tell its joints.
  [[nodiscard]] static Result<Head> create(std::shared_ptr<const RobotModel> robot);

  [[nodiscard]] const HeadDescription& description() const noexcept {
    return *robot_->description().head;
  }
  [[nodiscard]] HeadAngles rest() const noexcept { return rest_; }
  /// Where it gets to on the way to `angles`.
  [[nodiscard]] HeadAngles within_limits(const HeadAngles& angles) const noexcept;

  /// Moves the links that the head carries. T_world_link: of all links, world frame.
  void place(const HeadAngles& angles, std::span<Transform> T_world_link) const;

  /// The optical frame of its camera. T_world_link: of all links. Does not allocate.
  [[nodiscard]] Transform T_world_camera(const HeadAngles& angles,
                                         std::span<const Transform> T_world_link) const;

  /// Whether it carries a link.
  [[nodiscard]] bool carries(int link) const noexcept {
    return carriers_[idx(link)] != Carrier::kBody;
  }

  /// Where it has to turn for its camera to look at a point, or, where its limits do not let it,
  /// nearest to that: of several ways the one nearest to `from`. Does not allocate.
  [[nodiscard]] HeadAngles towards(const Eigen::Vector3d& p_world,
                                   std::span<const Transform> T_world_link,
                                   const HeadAngles& from) const;

 private:
  enum class Carrier : char { kBody, kPan, kTilt };
  struct Axis {
    std::size_t link = 0;
    std::size_t parent = 0;
    Transform T_parent_joint = Transform::Identity();
    Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  };
  /// Links on the way to the camera.
  struct Chain {
    Transform T_world_pan;
    Transform T_world_tilt;
    Transform T_world_camera;
  };

  Head(std::shared_ptr<const RobotModel> robot, const KinematicTree& tree);
  [[nodiscard]] Chain chain(const HeadAngles& angles,
                            std::span<const Transform> T_world_link) const;

  std::shared_ptr<const RobotModel> robot_;
  Axis pan_;
  Axis tilt_;
  std::size_t camera_ = 0;
  HeadAngles rest_;
  std::vector<Carrier> carriers_;  ///< Of each link.
};

}  // namespace sidestep
