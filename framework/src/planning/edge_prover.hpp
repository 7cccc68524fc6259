#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <sidestep/core/lanes.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "motion_bounds.hpp"

namespace sidestep {

/// Shows edges (straight motions in joint space) clear of the shapes of a scene, of the floor and
/// of the robot itself, over the whole of each edge, in lanes of configurations.
///
/// An edge is cut into eight parts, each looked at in its middle, all at once: so most edges in
/// collision are found out by the first look. A part is clear of a sphere whose distance there
/// exceeds its radius, the margin, and its way: how far its centre comes within half a part. Which
/// parts are not shown clear of which links is remembered, and they are cut into four, for those
/// links alone, until a sphere's way in a part is less than the resolution.
///
/// A link's spheres are first taken together, as a ball around one of them. The way of a sphere is
/// bounded by its levers (motion_bounds.hpp), and by the chord between the middles of two
/// neighbouring parts and how far the sphere can turn off it.
///
/// The same verdicts as ClearanceProver's, but for edges that one or the other cannot show clear at
/// its resolution, and for shapes beyond the bounds of the field, which here are in the way of
/// spheres that cross these bounds. Keeps its temporaries: one object per thread.
class EdgeProver {
 public:
  /// `bounds` are the robot's.
  EdgeProver(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const MotionBounds> bounds);

  /// What is to be avoided from now on.
  void look_at(std::shared_ptr<const SceneField> field, const SpacePolicy& space, double margin_m);

  [[nodiscard]] bool is_clear(std::span<const double> q);
  /// Of at most kLanes finite configurations, one after the other in `q`, those that are not clear:
  /// bit i for configuration i.
  [[nodiscard]] unsigned find_blocked(std::span<const double> q);
  [[nodiscard]] bool is_clear(std::span<const double> q_from, std::span<const double> q_to,
                              double resolution_m) {
    return is_clear(q_from, q_to, resolution_m, 0.0);
  }
  /// With so much more to spare, of everything, than the margin asks for.
  [[nodiscard]] bool is_clear(std::span<const double> q_from, std::span<const double> q_to,
                              double resolution_m, double spare_m);

 private:
  /// The spheres of one link, within one ball.
  struct Ball {
    int link = 0;
    int centre = 0;         ///< The sphere around whose centre the ball is.
    int outermost = 0;      ///< The sphere that moves farthest, whatever the joints do.
    double radius_m = 0.0;  ///< Of the ball.
    std::vector<int> spheres = {};
  };
  struct BallPair {
    std::size_t a, b;  ///< Balls.
    int pair;          ///< Of self_collision_pairs.
  };
  /// A part of the edge, and what it is not shown clear of: bit i of `balls` is for all balls whose
  /// number modulo 64 is i, and so for pairs.
  struct Part {
    double middle;
    std::uint64_t balls;
    std::uint64_t pairs;
  };
  /// What is known of kLanes parts while they are looked at.
  struct Look;

  [[nodiscard]] bool prove(double resolution_m);
  [[nodiscard]] bool look(std::span<const Part> parts, double half, double resolution_m);
  [[nodiscard]] bool look_at_ball(std::size_t number, Look& look);
  [[nodiscard]] unsigned find_blocked(std::size_t ball, unsigned open);
  [[nodiscard]] unsigned find_touching(std::size_t pair, unsigned open) const;
  [[nodiscard]] bool is_well_inside(const Ball& ball, std::size_t lane, double way_m) const;
  [[nodiscard]] bool look_at_sphere(std::size_t number, int sphere,
                                    std::span<const std::uint32_t> shapes, Look& look);
  [[nodiscard]] bool look_at_pair(std::size_t number, Look& look) const;
  void measure_edge();
  [[nodiscard]] double ball_way_m(std::size_t ball) const noexcept { return ways_m_.data()[ball]; }
  [[nodiscard]] double pair_way_m(std::size_t pair) const noexcept {
    return ways_m_.data()[balls_.size() + pair];
  }
  [[nodiscard]] double ball_bend_m(std::size_t ball);

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const SceneField> field_;
  SpacePolicy space_;
  FloorClearance above_floor_;
  bool is_bounded_ = false;  ///< Whether the floor or the field's bounds are in the way.
  double margin_m_ = 0.0;
  std::shared_ptr<const MotionBounds> bounds_;
  std::vector<Ball> balls_;
  std::vector<BallPair> pairs_;
  std::vector<std::size_t> order_;  ///< Of balls: those that were in the way last come first.
  std::vector<double> radius_m_;    ///< Of spheres.
  AlignedArray levers_;             ///< By joint, of balls and then of pairs; whole lanes each.

  // Of the edge that is looked at.
  double spare_m_ = 0.0;
  std::span<const double> q_from_;
  std::span<const double> q_to_;
  std::vector<double> variation_;
  AlignedArray ways_m_;              ///< By levers, over the whole edge: of balls, then of pairs.
  std::vector<double> ball_bend_m_;  ///< Negative until it is wanted.
  std::vector<Part> parts_;
  std::vector<Part> next_;
  std::vector<double> q_;
  std::vector<PointLanes> centres_;
  std::vector<std::uint32_t> shapes_;  ///< Near the ball that is looked at.
  std::vector<std::uint32_t> nearer_;
  Scratch scratch_;
};

}  // namespace sidestep
