#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/lanes.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/geometry/shape.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep {

/// One planned degree of freedom. Units: m for prismatic, rad for revolute and continuous.
struct Joint {
  enum class Type { kRevolute, kContinuous, kPrismatic };
  std::string name;
  Type type = Type::kRevolute;
  double lower = 0.0;  ///< -infinity for a continuous joint.
  double upper = 0.0;
  double max_velocity = 0.0;      ///< Per second; positive.
  double max_acceleration = 0.0;  ///< Of motions, per second squared; infinity where unknown.
  /// Of stops, per second squared, finite and no less than max_acceleration, which it is where
  /// nothing is said.
  std::optional<double> max_braking = {};

  /// With which it may lose speed where the robot is to stop, per second squared. [any]
  [[nodiscard]] double braking() const noexcept { return max_braking.value_or(max_acceleration); }

  /// Of its position.
  [[nodiscard]] const char* unit() const noexcept { return type == Type::kPrismatic ? "m" : "rad"; }
};

struct Link {
  std::string name;
  int parent = -1;  ///< Index of the parent link; -1 for the root.
};

/// A collision sphere, fixed to a link.
struct CollisionSphere {
  int link = 0;
  Eigen::Vector3d centre_link_m = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
};

/// A collision shape of the URDF, fixed to a link: the truth the spheres must cover.
struct CollisionShape {
  int link = 0;
  Shape shape;
  Transform T_link_shape = Transform::Identity();
};

struct NamedPose {
  std::string name;
  /// One entry per joint of the model; nothing for joints the pose leaves as they are.
  std::vector<std::optional<double>> positions;
};

/// A head that turns a camera: two revolute joints, which are not planned. Its rest is where the
/// robot's links have it. Of robots that tell their joints (KinematicTree). Plain data.
struct HeadDescription {
  struct Axis {
    Joint joint;
    int link = 0;  ///< That the joint moves.
  };
  Axis pan;
  Axis tilt;            ///< Carried by the pan joint.
  int camera_link = 0;  ///< Carried by the tilt joint; its frame is the camera's optical one.
};

/// A base on wheels that do not slip: it drives ahead and back along the x axis of the link that
/// its heading turns, and turns on the spot about that link's origin, but does not move sideways.
/// Its speed along that axis is at most the velocity limit of `x`, which `y` has, too. Plain data.
struct RollingBase {
  int x = 0, y = 1;  ///< Joints along the world's x and y.
  int yaw = 2;       ///< The joint of the heading, 0 along the world's x.
};

/// All that is constant about a robot. Plain data.
struct RobotDescription {
  std::string name;
  std::vector<Joint> joints;  ///< The planned ones; fixes the order of every q.
  std::vector<Link> links;    ///< Parents before children.
  std::vector<CollisionSphere> spheres;
  std::vector<CollisionShape> shapes;
  /// Pairs of link indices, lower first, that are checked against each other for
  /// self-collision; those that always or never touch are left out.
  std::vector<std::pair<int, int>> self_collision_pairs;
  std::vector<NamedPose> poses;
  std::optional<HeadDescription> head;  ///< Nothing: no camera turns.
  std::optional<RollingBase> rolling;   ///< Nothing: joints move as they like.

  [[nodiscard]] int dof() const noexcept { return static_cast<int>(joints.size()); }
  [[nodiscard]] std::optional<int> joint_index(std::string_view joint_name) const noexcept;
  [[nodiscard]] std::optional<int> link_index(std::string_view link_name) const noexcept;
  [[nodiscard]] const NamedPose* find_pose(std::string_view pose_name) const noexcept;
  /// The joints that move a base along x and y: the first two that are prismatic.
  [[nodiscard]] std::optional<std::array<int, 2>> planar_base() const noexcept;
};

/// A force on a link in one configuration of a batch, world frame.
struct LinkForce {
  int row = 0;  ///< Of the batch.
  int link = 0;
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();  ///< About the world's origin.
};

/// A robot's kinematics. Configurations are batches: q holds n rows of dof() values, row by
/// row, in description().joints order. Immutable; temporaries live in the caller's Scratch.
/// Every method: [any] thread with its own Scratch; no allocation once the Scratch is warm.
class SIDESTEP_EXPORT RobotModel {
 public:
  virtual ~RobotModel() = default;

  [[nodiscard]] virtual const RobotDescription& description() const noexcept = 0;

  /// Poses of all links for one configuration. q: dof(). T_world_link: links.size().
  virtual void link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                          Scratch& scratch) const = 0;

  /// Centres of all spheres. q: n x dof(). centres_m: n x spheres.size(), world frame.
  virtual void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                              Scratch& scratch) const = 0;

  /// The same in lanes: the centre of sphere s in configuration kLanes * g + lane is lane `lane` of
  /// centres_m[g * spheres.size() + s]; lanes beyond the last configuration hold any numbers.
  virtual void sphere_centre_lanes(std::span<const double> q, std::span<PointLanes> centres_m,
                                   Scratch& scratch) const;

  /// Centres and their Jacobians. jacobians: n x spheres.size() x dof() columns, each the
  /// derivative of one centre by one joint (m per m or m per rad), world frame.
  virtual void sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                                std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const = 0;

  /// Maps forces on links onto joints, one by one, as in statics: joint_forces[k][j] is the work of
  /// forces[k] as joint j moves by one unit. With force g at a sphere's centre c (moment c x g)
  /// that is g . J of the centre; with no force and a moment, the turning of the link. forces: in
  /// ascending order of row; q: n x dof(). joint_forces: forces.size() x dof().
  virtual void pull_back(std::span<const double> q, std::span<const LinkForce> forces,
                         std::span<double> joint_forces, Scratch& scratch) const = 0;
};

/// Which collision spheres no joint moves: those of the foot of an arm, say. Tried on a few
/// configurations. [any]; allocates.
[[nodiscard]] SIDESTEP_EXPORT std::vector<bool> fixed_spheres(const RobotModel& robot);

}  // namespace sidestep
