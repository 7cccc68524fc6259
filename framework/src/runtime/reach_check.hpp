#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include <sidestep/mapping/moving_obstacles.hpp>
#include <sidestep/mapping/tracks.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/replanner.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep::detail {

/// A motion that goes on until it brakes, and then comes to rest as fast as limits allow: where the
/// robot's spheres are on it.
struct Contingency {
  double begin_s = 0.0;         ///< On the motion's clock, as brake_s.
  double brake_s = 0.0;         ///< When braking begins.
  std::vector<double> times_s;  ///< Of the states that are looked at, after begin_s; ascending.
  std::vector<Eigen::Vector3d> centres_m;    ///< Of all spheres, state by state. World frame.
  std::vector<Eigen::AlignedBox3d> boxes_m;  ///< Around the centres of each state.
};

/// Passive safety (Macek, Vasquez, Fraichard and Siegwart, "Towards safe vehicle navigation in
/// dynamic urban scenarios", 2009): nothing that has been seen moving, and neither is faster nor
/// turns sooner than it is taken to, can reach the robot before it is at rest.
class ReachCheck {
 public:
  /// Of the settings: how fast things move (0: nothing is looked at) and how soon they turn, and
  /// what spheres keep besides.
  ReachCheck(std::shared_ptr<const RobotModel> robot, MotionLimits limits,
             const ReplannerSettings& settings);

  /// What moves, and what is tracked besides; either may be null. A track whose numbers are not
  /// finite could reach the robot anywhere.
  void look_at(const MovingObstacles* moving, const Tracks* tracks);
  /// Whether anything moves that could reach the robot anywhere.
  [[nodiscard]] bool sees_anything() const noexcept {
    return speed_mps_ > 0.0 && (has_lost_track_ || !movers_.empty());
  }

  /// `motion` from `from_s` on, braking at `brake_s`, along the path where that can be, else beside
  /// it; nothing where neither can be. Most of what first_reach() costs.
  [[nodiscard]] std::optional<Contingency> contingency(const Trajectory& motion, double from_s,
                                                       double brake_s) const;

  /// What could reach the robot on a contingency, which begins at the stamp `begin`, from `now` on;
  /// nothing where nothing could.
  [[nodiscard]] std::optional<std::string> first_reach(const Contingency& contingency, Stamp begin,
                                                       Stamp now) const;

  /// What could reach the robot if it followed `motion` from `from_s`, which is `now`, until
  /// `brake_s`, and then came to rest; nothing where nothing could.
  [[nodiscard]] std::optional<std::string> first_reach(const Trajectory& motion, double from_s,
                                                       double brake_s, Stamp now) const;

 private:
  /// A part of what moves, as it was seen.
  struct Mover {
    MovingBall ball;
    std::optional<Eigen::Vector3d> velocity_mps;  ///< Nothing: it may go anywhere at once.
    Stamp seen;
  };
  /// A ball in which a mover is for some time; those of one mover all hold, so that it is where
  /// they overlap.
  struct Reach {
    Eigen::Vector3d centre_m;
    double radius_m;
  };

  void add_track(const Track& track, Stamp seen);
  [[nodiscard]] std::array<Reach, 2> reaches(const Mover& mover, double after_s) const;
  [[nodiscard]] std::optional<Trajectory> until_rest(const Trajectory& motion, double from_s,
                                                     double brake_s) const;

  std::shared_ptr<const RobotModel> robot_;
  MotionLimits limits_;
  double speed_mps_;
  std::optional<double> acceleration_mps2_;  ///< Of tracks; nothing: they turn at once.
  double out_of_view_s_;
  double margin_m_;
  std::vector<bool> fixed_;  ///< Spheres that never move: they run into nobody.
  bool counts_standing_;     ///< People who stand, too.
  bool has_lost_track_ = false;
  double largest_m_ = 0.0;  ///< Radius of the largest sphere.
  std::vector<Mover> movers_;
};

}  // namespace sidestep::detail
