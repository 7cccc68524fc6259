#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include <sidestep/core/scratch.hpp>
#include <sidestep/planning/shape_obstacles.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "shape_collider.hpp"
#include "shape_motion.hpp"

namespace sidestep {

/// What the shapes of a robot must keep away from.
struct ShapeWorld {
  ShapeObstacles obstacles;  ///< As they stand at scene_time_s.
  std::vector<AllowedContact> allowed;
  /// Where the centres of the robot's spheres must stay, if anywhere.
  std::optional<Eigen::AlignedBox3d> bounds_m;
  double margin_m = 0.0;       ///< Least distance to obstacles.
  double self_margin_m = 0.0;  ///< Least distance of links that are checked against each other.
};

/// Shows configurations, and straight motions in joint space, clear by FCL on the collision shapes
/// of a robot's URDF: what MotionCheck does with spheres on a field, for planners that are to plan
/// with the shapes themselves. Knows no limits. Keeps its temporaries: one object per thread.
/// Allocates.
class ShapePaths {
 public:
  /// The robot has bounded collision shapes, and `world` names links and objects that exist.
  ShapePaths(std::shared_ptr<const RobotModel> robot, ShapeWorld world);

  /// True if one configuration (dof values) keeps the margins.
  [[nodiscard]] bool is_clear(std::span<const double> q);

  /// True if the straight line between two configurations is shown to keep the margins, ends
  /// included: from the middle outward, each configuration shows clear what lies so near that no
  /// shape moves farther than it is away. A motion for which that takes steps in which no shape
  /// moves more than `resolution_m` counts as blocked.
  [[nodiscard]] bool is_clear(std::span<const double> q_from, std::span<const double> q_to,
                              double resolution_m);

  /// What is worst about a configuration that is not clear; nothing where it is.
  [[nodiscard]] std::optional<Violation> violation(std::span<const double> q);

 private:
  /// What is looked at: the bounds, a shape against obstacles, or a pair of shapes.
  using Item = int;
  enum class Shown { kClear, kOpen, kBlocked };
  /// A part of a motion, and what has not been shown clear in all of it.
  struct Part {
    double middle;
    std::shared_ptr<const std::vector<Item>> items;
  };

  void place(std::span<const double> q);
  /// Places the robot at the middle of a part. Nothing where something is blocked there, else what
  /// is not shown clear while each joint's way is at most `ways_`.
  [[nodiscard]] std::optional<std::vector<Item>> look_at(const std::vector<Item>& items);
  [[nodiscard]] Shown look_at(Item item);
  [[nodiscard]] Shown look_at_bounds();
  [[nodiscard]] double robot_way_m() const;
  [[nodiscard]] double link_way_m(int link);
  [[nodiscard]] double pair_way_m(int pair) const;
  [[nodiscard]] double inside_m() const;
  void look_at_first(Item item);

  std::shared_ptr<const RobotModel> robot_;
  ShapeWorld world_;
  ShapeMotion motion_;
  ShapeCollider collider_;
  ShapeCollider::PosePtr pose_;
  std::shared_ptr<const std::vector<Item>> all_;  ///< What was blocked last comes first.
  std::vector<Transform> poses_;                  ///< Of links.
  std::vector<double> q_;
  std::vector<double> ways_;
  std::vector<double> link_ways_m_;  ///< For `ways_`; negative where not known yet.
  std::vector<Eigen::Vector3d> centres_m_;
  Scratch scratch_;
};

}  // namespace sidestep
