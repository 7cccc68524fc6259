#pragma once

#include <initializer_list>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/robot/head.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "shape_collider.hpp"

namespace sidestep {

/// Keeps a head that turns apart from the rest of its robot, by the collision shapes of its URDF,
/// and by the head's spheres from obstacles. Motions are planned with the head at rest. [planning]
class HeadGuard {
 public:
  /// `margin_m`: of the head from obstacles, as far as it has it at rest.
  HeadGuard(std::shared_ptr<const RobotModel> robot, const Head& head, double margin_m);

  /// Looks at the robot in a configuration, and as a way, which may be null, goes on from a time of
  /// it for as long as the head may need to its rest. `field`: null: there are no obstacles.
  void see(std::span<const double> q, const Trajectory* way, double from_s,
           std::shared_ptr<const DistanceField> field = nullptr);
  /// Whether the head keeps apart anywhere between some angles and its rest, whichever of its
  /// joints comes first. After see().
  [[nodiscard]] bool is_clear(std::initializer_list<HeadAngles> between);

 private:
  /// Angles on a lattice.
  using Place = std::pair<int, int>;
  /// The robot but for its head, in the frame of what carries that.
  struct Body {
    std::vector<Transform> poses;            ///< Of all links.
    std::vector<Eigen::Vector3d> centres_m;  ///< Of body_spheres_.
    Transform T_world_carrier;
  };

  /// The head at a place, in the same frame.
  struct Turned {
    std::vector<Eigen::Vector3d> centres_m;  ///< Of head_spheres_.
    Eigen::Vector3d middle_m;                ///< Of a ball that has all of them in it.
    double radius_m = 0.0;
  };

  /// Where something is near the head.
  struct Spot {
    Transform T_world_carrier;
    double margin_m;
  };

  [[nodiscard]] Body body(std::span<const double> q);
  void see_spot(const Transform& T_world_carrier);
  [[nodiscard]] double clearance_m(const Turned& head, const Transform& T_world_carrier);
  [[nodiscard]] bool is_clear_of_obstacles(const Turned& head);
  [[nodiscard]] Turned turned(const HeadAngles& angles) const;
  [[nodiscard]] bool is_apart(const Place& place);
  [[nodiscard]] bool is_apart(const HeadAngles& angles, const Turned& head, const Body& body);
  [[nodiscard]] bool are_spheres_apart(const Turned& head, const Body& body) const;

  std::shared_ptr<const RobotModel> robot_;
  Head head_;
  ShapeCollider collider_;
  ShapeCollider::PosePtr pose_;
  std::vector<int> pairs_;  ///< Of shapes, of which the head carries one.
  std::vector<CollisionSphere> head_spheres_;
  std::vector<CollisionSphere> body_spheres_;  ///< Of the links of these pairs.
  std::map<Place, Turned> heads_;
  std::vector<Body> bodies_;     ///< Different ones.
  std::map<Place, bool> known_;  ///< Of these bodies.
  double ahead_s_ = 0.0;
  double margin_m_;
  std::vector<Transform> poses_;  ///< Of all links, in the frame of what carries the head.
  Turned rest_;
  double reach_m_ = 0.0;  ///< Of the head's spheres, however it turns, from where it pans.
  std::shared_ptr<const DistanceField> field_;
  std::vector<Spot> spots_;
  std::map<Place, bool> clear_;  ///< Of these obstacles.
  std::vector<Eigen::Vector3d> centres_m_;
  std::vector<double> distances_m_;
  Scratch scratch_;
};

}  // namespace sidestep
