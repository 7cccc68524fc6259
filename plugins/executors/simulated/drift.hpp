#pragma once

#include <cstdint>
#include <optional>

#include <sidestep/robot/base_joints.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep::simulated {

/// A step of SplitMix64.
[[nodiscard]] std::uint64_t mix(std::uint64_t value);
/// The next random number in (0, 1).
[[nodiscard]] double uniform(std::uint64_t& state);

/// Where a base truly is that measures its way by its wheels: a share of it longer or shorter, and
/// turned a little with each metre.
class Drift {
 public:
  /// To which side, the seed says. Fails with kUnsupported where the robot is to drift, and has no
  /// such base.
  [[nodiscard]] static Result<Drift> create(double share, double rad_per_m, const RobotModel& robot,
                                            std::uint64_t seed);

  /// By one step of what is measured.
  void step(const Eigen::VectorXd& from, const Eigen::VectorXd& to);

  [[nodiscard]] RobotState truth(RobotState measured) const;

 private:
  std::optional<BaseJoints> base_;
  double share_ = 0.0;
  double rad_per_m_ = 0.0;
  Transform T_world_odom_ = Transform::Identity();
};

}  // namespace sidestep::simulated
