#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// Where a robot comes nearest to something.
struct Clearance {
  double distance_m = 0.0;  ///< Negative: a depth.
  std::string link;
  std::string object;       ///< "map" where only the map is known.
  Eigen::Vector3d point_m;  ///< Of the sphere's surface, towards the object; world frame.
};

/// How near a robot's spheres come to what is around it.
class RobotClearance {
 public:
  /// A link this near to an object at the start stands on it, or holds it: the pair is ignored.
  /// So is a link that keeps its height above a plane, as a base does above the floor.
  static constexpr double kStanding_m = 0.05;

  /// `scene` as it truly is, or null. q_start: the robot's, at the scene's time 0.
  RobotClearance(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const Scene> scene,
                 std::span<const double> q_start);

  /// To the true scene at this time where it is known, else to what `field` knows; nothing where
  /// neither says anything. `field` may be null.
  [[nodiscard]] std::optional<Clearance> find(std::span<const double> q, double time_s,
                                              const DistanceField* field);

 private:
  [[nodiscard]] std::optional<Clearance> to_scene(double time_s) const;
  [[nodiscard]] std::optional<Clearance> to_field(const DistanceField& field) const;
  [[nodiscard]] bool counts(int link, std::size_t object) const noexcept;
  [[nodiscard]] Clearance clearance(std::size_t sphere, double distance_m,
                                    const Eigen::Vector3d& gradient, std::string object) const;

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const Scene> scene_;
  std::vector<std::uint8_t> ignored_;  ///< links x objects.
  std::vector<Eigen::Vector3d> centres_m_;
  Scratch scratch_;
};

}  // namespace sidestep
