#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/time.hpp>
#include <sidestep/planning/problem.hpp>

namespace sidestep {

/// The ways of a robot's base to a problem's goal: Dijkstra from the goal on a grid of positions (a
/// voxel, at least 0.05 m, apart; at most 200 along a side of the field), for all that is at most
/// twice as far as the start. The robot keeps collision_margin_m from obstacles on them, or as much
/// as at the start where that is less; where there is no such way, half a cell less, as there may
/// be one between the positions. Open ways are preferred. Between start and goal the joints that
/// are not the base's change with the way as the crow flies. What moves, the floor and the robot
/// itself are not looked at.
class BaseWays {
 public:
  /// Empty where the problem has no field, the robot no base (RobotDescription::planar_base()),
  /// there is no way from start to goal, or no time to find it.
  BaseWays(const Problem& problem, const Deadline& deadline);

  [[nodiscard]] bool empty() const noexcept { return first_ < 0; }

  /// From the start to the goal, with the problem's dt_s, and as many more support states as the
  /// way is longer than the straight one. A rolling base goes ahead or back to where it can turn,
  /// turns on the spot, drives along the way, and turns to the goal's heading. Not for empty ones.
  [[nodiscard]] Trajectory first_guess(const Problem& problem) const;

  /// The length of the way from where the base is in a configuration, tight places counting for up
  /// to four times as much; nothing where none is known. In m.
  [[nodiscard]] std::optional<double> length_m(std::span<const double> q) const;

 private:
  struct Position {
    double cost_m;
    std::int32_t next = -1;  ///< Towards the goal.
  };
  class Search;

  [[nodiscard]] Eigen::Vector2d at(std::span<const double> q) const;
  [[nodiscard]] Eigen::Vector2d position_m(std::int32_t node) const;
  [[nodiscard]] std::int32_t nearest(const Eigen::Vector2d& p_m) const;

  int x_ = 0, y_ = 0;  ///< Joints.
  double cell_m_ = 0.0;
  Eigen::Vector2d goal_m_ = Eigen::Vector2d::Zero();
  Eigen::Vector2i half_ = Eigen::Vector2i::Zero();  ///< Positions on either side of the goal.
  std::vector<Position> positions_;
  std::int32_t first_ = -1;  ///< Of the way from the start, or from where a rolling base turns,
  Eigen::Vector2d to_turn_m_ = Eigen::Vector2d::Zero();  ///< so far from it.
};

}  // namespace sidestep
