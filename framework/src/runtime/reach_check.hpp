#pragma once

#include <memory>
#include <optional>
#include <string>

#include <sidestep/mapping/moving_obstacles.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep::detail {

/// Passive safety (Macek, Vasquez, Fraichard and Siegwart, "Towards safe vehicle navigation in
/// dynamic urban scenarios", 2009): nothing that has been seen moving, and is no faster than it is
/// taken to be, can reach the robot before it is at rest.
class ReachCheck {
 public:
  /// `speed_mps`: of what moves; 0: nothing is looked at. `margin_m`: that spheres keep besides.
  ReachCheck(std::shared_ptr<const RobotModel> robot, MotionLimits limits, double speed_mps,
             double margin_m);

  void look_at(std::shared_ptr<const MovingObstacles> moving) { moving_ = std::move(moving); }

  /// What could reach the robot if it followed `motion` from `from_s`, which is `now`, until
  /// `brake_s`, and then came to rest as fast as its limits allow; nothing where nothing could.
  [[nodiscard]] std::optional<std::string> first_reach(const Trajectory& motion, double from_s,
                                                       double brake_s, Stamp now) const;

 private:
  [[nodiscard]] std::optional<Trajectory> until_rest(const Trajectory& motion, double from_s,
                                                     double brake_s) const;

  std::shared_ptr<const RobotModel> robot_;
  MotionLimits limits_;
  double speed_mps_;
  double margin_m_;
  std::shared_ptr<const MovingObstacles> moving_;
};

}  // namespace sidestep::detail
