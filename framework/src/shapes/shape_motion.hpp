#pragma once

#include <array>
#include <vector>

#include <sidestep/core/scratch.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// One joint between two support states as a Bezier curve in u = 0..1: the hull of its control
/// values contains the curve, and its derivative's hull the velocities.
struct BezierJoint {
  std::array<double, 4> position;      // control values
  std::array<double, 3> velocity;      // per second
  std::array<double, 2> acceleration;  // per second squared

  [[nodiscard]] static BezierJoint between(double q0, double v0, double q1, double v1, double h_s);

  /// Bound on |velocity| over [from, to] within [0, 1]; exact as the interval shrinks.
  [[nodiscard]] double fastest(double from, double to) const;

  /// The value farthest above `limit` over [from, to] of a curve with these control values, and
  /// where; nothing above it beyond `tolerance` gives excess 0.
  struct Excess {
    double amount = 0.0;
    double u = 0.0;
  };
  template <std::size_t n>
  [[nodiscard]] static Excess above(const std::array<double, n>& controls, double limit,
                                    double tolerance, double from, double to);
};

extern template BezierJoint::Excess BezierJoint::above(const std::array<double, 4>&, double, double,
                                                       double, double);
extern template BezierJoint::Excess BezierJoint::above(const std::array<double, 3>&, double, double,
                                                       double, double);
extern template BezierJoint::Excess BezierJoint::above(const std::array<double, 2>&, double, double,
                                                       double, double);

/// Bounds on how far points of the robot's shapes move: turn and shift of each link against its
/// parent per unit of each joint, times distances that are measured where the step begins.
class ShapeMotion {
 public:
  explicit ShapeMotion(const RobotModel& robot);

  /// How far any point of the shapes of each link moves while each joint's way is at most
  /// `ways`. True as long as nothing of the robot moves more than `limit_m` in all. Links
  /// without shapes get 0. `from`: the links' poses when the step begins. Against the frame of
  /// the last link common with `other` where that is given, else against the world.
  [[nodiscard]] double link_way_m(int link, const std::vector<Transform>& from,
                                  const std::vector<double>& ways, double limit_m,
                                  int other = -1) const;
  /// The longest of all links against the world.
  [[nodiscard]] double robot_way_m(const std::vector<Transform>& from,
                                   const std::vector<double>& ways, double limit_m) const;
  /// The same of the centres of the robot's spheres, and of its links' origins. Spheres may reach
  /// farther than a link's shapes, or be on links without.
  [[nodiscard]] double centres_way_m(const std::vector<Transform>& from,
                                     const std::vector<double>& ways, double limit_m) const;

 private:
  /// Of all points of a link that are no farther from its origin than `radius_m`.
  [[nodiscard]] double point_way_m(int link, double radius_m, const std::vector<Transform>& from,
                                   const std::vector<double>& ways, double limit_m,
                                   int other) const;

  const RobotDescription& robot_;
  std::vector<double> radius_m_;  // links: farthest point of a shape; negative without shapes
  std::vector<double> centre_radius_m_;  // links: farthest centre of a sphere; 0 without spheres
  std::vector<double> turn_rate_;        // links x joints, rad per unit
  std::vector<double> shift_rate_;       // links x joints, m per unit
};

/// Farthest point of a shape from the origin of its link; infinity for a half-space.
[[nodiscard]] double farthest_point_m(const CollisionShape& shape);

}  // namespace sidestep
