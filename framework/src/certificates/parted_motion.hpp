#pragma once

#include <map>
#include <span>
#include <vector>

#include <sidestep/certificates/body.hpp>
#include <sidestep/certificates/polynomial_motion.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {

/// A part of a motion: from index / 2^level of it on.
struct MotionPart {
  int level = 0;
  std::int64_t index = 0;
  friend auto operator<=>(const MotionPart&, const MotionPart&) = default;
};

/// A robot's motion in halves of halves: where it is in the middle of each, and how far its shapes
/// come from there (docs/reference/certificates.md). Not for several threads at once.
class PartedMotion {
 public:
  /// How far a point of a shape may come within a part by its carriers up to this one: no farther
  /// than `way_m`, and along n no farther than the sum of their |n . turn_m| and `more_m`.
  struct Carried {
    double way_m = 0.0;
    double more_m = 0.0;
    Eigen::Vector3d turn_m = Eigen::Vector3d::Zero();  ///< Of this one alone.
  };
  /// The robot in the middle of a part, and how far each joint goes from there.
  struct Instant {
    double time_s = 0.0;
    std::vector<Transform> links;
    std::vector<double> ways;
    /// Of each shape and each of its carriers; empty until it is asked for.
    std::vector<std::vector<Carried>> carried;
  };

  /// Keeps references to robot and motion. `shapes`: of the robot, in its order.
  PartedMotion(const KinematicTree& robot, const PolynomialMotion& motion,
               const std::vector<Body>& shapes);

  [[nodiscard]] std::pair<double, double> span_s(const MotionPart& part) const;
  /// Stays where it is.
  [[nodiscard]] Instant& at(const MotionPart& part);
  /// Of a shape by the first of its carriers, as many.
  [[nodiscard]] std::span<const Carried> carried(Instant& at, std::size_t shape,
                                                 std::size_t carriers) const;
  /// How many links carry a shape that joints move, from its own inwards; up to one and without it,
  /// which is above the shape's (-1: the world).
  [[nodiscard]] std::size_t carriers_beyond(int link, std::size_t shape) const;

 private:
  const KinematicTree& robot_;
  const PolynomialMotion& motion_;
  std::vector<std::vector<int>> carriers_;  ///< Of each shape.
  std::vector<double> reaches_m_;           ///< Of each shape.
  std::map<MotionPart, Instant> instants_;
  Scratch scratch_;
};

}  // namespace sidestep
