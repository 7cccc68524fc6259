#pragma once

#include <memory>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// Finds the robot's own points: those inside one of its collision spheres, inflated by a
/// margin, where it stood at the frame's stamp. Mappers drop such a measurement whole: it
/// neither inserts its end nor clears along its ray.
class SelfFilter {
 public:
  struct Ball {
    Eigen::Vector3d centre_m;  ///< World frame.
    double radius_m;           ///< Margin included.
  };

  /// `robot` may be null: then nothing is ever removed.
  SelfFilter(std::shared_ptr<const RobotModel> robot, double margin_m)
      : robot_(std::move(robot)), margin_m_(margin_m) {}

  /// Poses the spheres for a frame; with no joint positions there are none. Fails with
  /// kBadFrame where the joint positions do not fit the robot. [mapping]; allocates at first.
  [[nodiscard]] Result<void> pose(const Frame& frame);

  [[nodiscard]] const std::vector<Ball>& balls() const noexcept { return balls_; }

  /// Whether a point of the world lies inside the robot. [any] between calls of pose().
  [[nodiscard]] bool contains(const Eigen::Vector3d& p_world) const noexcept;

 private:
  std::shared_ptr<const RobotModel> robot_;
  double margin_m_;
  std::vector<Ball> balls_;
  std::vector<Eigen::Vector3d> centres_m_;
  Eigen::Vector3d lower_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d upper_m_ = Eigen::Vector3d::Zero();
  Scratch scratch_;
};

}  // namespace sidestep
