#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/planning/problem.hpp>

#include "checker.hpp"

namespace sidestep::joint_paths {

/// How a robot gets from one configuration to another: straight through joint space; on a rolling
/// base it turns, drives ahead or back, whichever it has to turn less for, and turns, while the
/// other joints go on evenly. There and back are the same way.
class Steering {
 public:
  /// Straight.
  Steering() = default;
  /// Configurations are given as joint positions times `scale`.
  Steering(const RobotDescription& robot, std::vector<double> scale)
      : base_(robot.rolling), scale_(std::move(scale)) {}

  [[nodiscard]] bool is_straight() const noexcept { return !base_; }
  /// Whether a joint may move by itself.
  [[nodiscard]] bool is_free(std::size_t joint) const noexcept;
  /// Appends the ends of the straight motions after `from` to `way`: at most three, the last `to`.
  void append(std::span<const double> from, std::span<const double> to,
              std::vector<double>& way) const;

 private:
  std::optional<RollingBase> base_;
  std::vector<double> scale_;
};

/// One such way: its vertices, and what is between them.
class Way {
 public:
  void look(const Steering& steering, std::span<const double> from, std::span<const double> to);

  /// Both ends included, one after the other.
  [[nodiscard]] std::span<const double> vertices() const noexcept { return vertices_; }
  /// The sum of the straight motions' Euclidean lengths.
  [[nodiscard]] double length() const noexcept { return length_; }
  /// Where it is after a part, 0 to 1, of its length.
  void at(double part, std::span<double> between) const noexcept;

 private:
  [[nodiscard]] std::span<const double> vertex(std::size_t number) const noexcept {
    return std::span(vertices_).subspan(number * dof_, dof_);
  }

  std::size_t dof_ = 0;
  std::vector<double> vertices_;
  double length_ = 0.0;
};

/// The fastest motion of a rolling base along a path, from vertex to vertex as it gets there.
/// Where it would stop between two drives in the same direction, it drives through on a curve, if
/// `checker` shows that clear; the largest of a few. Fails as retime() does. Allocates.
[[nodiscard]] Result<Trajectory> drive(const Problem& problem, std::span<const double> path,
                                       Checker& checker, double resolution_m,
                                       const Deadline& deadline);

}  // namespace sidestep::joint_paths
