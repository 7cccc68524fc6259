#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/robot/head.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/shape_check.hpp>

namespace sidestep {

/// Where a robot truly was, on the scene's clock.
struct TruePose {
  double time_s = 0.0;
  Eigen::VectorXd q;
  std::optional<HeadAngles> head;  ///< Nothing: at rest, or it has none.
};

/// A robot against an object of the scene, or its head against another of its links, from the first
/// touch to the last.
struct TrueContact {
  std::string link;  ///< That was deepest in.
  std::string object;
  double begin_s = 0.0;
  double end_s = 0.0;
  double depth_m = 0.0;
  /// At the first touch: how fast the robot's touching shape went towards the object; 0 for a link.
  double approach_mps = 0.0;
  bool is_own = false;  ///< The object is a link of the robot.

  /// Whose contact it was: the robot's, or that of somebody who walked into it.
  [[nodiscard]] bool is_by_robot() const noexcept {
    return is_own || approach_mps > kOwnApproach_mps;
  }
  static constexpr double kOwnApproach_mps = 0.02;
};

/// How near a robot came to anything at a time.
struct TrueClearance {
  double time_s = 0.0;
  double clearance_m = 0.0;  ///< 0 where it touches something.
};

struct TrueMotion {
  /// Least of all poses; negative: minus a depth. What is farther than was searched counts so.
  double min_clearance_m = 0.0;
  std::string nearest_link;  ///< Empty where nothing came near.
  std::string nearest_object;
  double nearest_s = 0.0;
  std::vector<TrueContact> contacts;  ///< In the order in which they began.
  /// From all but half-spaces, at poses at least `every_s` apart.
  std::vector<TrueClearance> clearances;
};

struct TrueMotionSettings {
  double farthest_m = 0.5;            ///< Clearances are searched up to this.
  double every_s = 0.1;               ///< Between two of TrueMotion::clearances.
  double farthest_over_time_m = 2.0;  ///< These are searched up to this.
  double apart_s = 0.5;  ///< Touches of one object that are nearer in time are one contact.
  std::vector<AllowedContact> allowed_contacts;
};

/// What a robot that was at these poses truly touched: the collision shapes of its URDF against the
/// scene at each pose's time, and those that its head carries against the rest of it, with FCL; no
/// map, no spheres. Poses in order of time. Fails as
/// make_shape_check() does, and with kInvalidArgument for a pose of another size. [any]; allocates.
[[nodiscard]] Result<TrueMotion> check_true_motion(const std::shared_ptr<const RobotModel>& robot,
                                                   const std::shared_ptr<const Scene>& scene,
                                                   std::span<const TruePose> poses,
                                                   const TrueMotionSettings& settings);

}  // namespace sidestep
