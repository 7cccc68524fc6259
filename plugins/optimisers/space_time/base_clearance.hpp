#pragma once

#include <array>
#include <span>
#include <vector>

#include <sidestep/planning/problem.hpp>

#include "base_motion.hpp"

namespace sidestep::detail {

/// The joints other than the base's: one cubic each from start to goal.
class OtherJoints {
 public:
  OtherJoints(const Problem& problem, std::array<int, 2> base);

  [[nodiscard]] double duration_s() const noexcept { return duration_s_; }
  /// Writes their positions at a time and, where these are wanted, velocities.
  void sample(double time_s, std::span<double> q, std::span<double> qdot) const;

 private:
  const Problem& problem_;
  std::array<int, 2> base_;
  double duration_s_ = 0.0;
};

/// How clear a robot is of the field and of what is predicted, by place of its base and time: when
/// its spheres are where about the base is known beforehand.
class BaseClearance {
 public:
  /// `margin_m`: beyond the problem's margins, and by how much robot and sets may come nearer
  /// between two looks. `speed_mps`: of the base at most.
  BaseClearance(const Problem& problem, std::array<int, 2> base, const OtherJoints& others,
                double margin_m, double speed_mps);

  /// Whether the base carries the whole robot.
  [[nodiscard]] bool carries_all() const noexcept { return carries_all_; }

  /// Whether the robot is clear at an instant.
  [[nodiscard]] bool is_clear(const Eigen::Vector2d& p_m, double time_s) {
    return clear_for_s(p_m, time_s) >= 0.0;
  }

  /// Whether the robot is clear while its base makes a stretch, which begins at `begin_s`. Up to
  /// `sure_until_s` it is known to be; afterwards that is the end of the stretch or later. Looks
  /// only when robot and sets could have come as near as the margins since the last look.
  [[nodiscard]] bool passes(const BaseState& from, const Stretch& stretch, double begin_s,
                            double& sure_until_s);

 private:
  /// For how long from an instant the robot is sure to be clear, however the base moves on;
  /// negative where it is not clear then.
  double clear_for_s(const Eigen::Vector2d& p_m, double time_s);
  /// Of the spheres from what stands and from what is predicted.
  struct Clearance {
    double standing_m, moving_m;
  };
  Clearance at(const Eigen::Vector2d& p_m, double time_s);
  [[nodiscard]] double far_from_moving_m(const Eigen::Vector3d& base_m, double time_s) const;
  void find_outer();
  [[nodiscard]] bool is_within(const Eigen::Vector2d& p_m) const noexcept;

  const Problem& problem_;
  std::array<int, 2> base_;
  double closing_mps_;         ///< Of any sphere and what stands, at most.
  double sets_mps_ = 0.0;      ///< Of what is predicted.
  double least_look_s_ = 0.0;  ///< Between two looks.
  Clearance kept_m_{};
  bool carries_all_ = true;
  std::array<Eigen::Vector3d, 2> axes_;     ///< By which all spheres move with the base.
  std::vector<Eigen::Vector3d> offsets_m_;  ///< Of spheres from the base, at instants evenly apart.
  std::vector<double> above_floor_m_;       ///< The lowest sphere's, then.
  CollisionSphere around_;                  ///< All spheres at all times, from the base.
  std::vector<std::size_t> outer_;          ///< Spheres that may be first to meet a set.
  std::vector<Eigen::Vector3d> centres_m_, outer_centres_m_;
  std::vector<double> distances_m_;
  std::vector<FieldStatus> statuses_;
};

}  // namespace sidestep::detail
