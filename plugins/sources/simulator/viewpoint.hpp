#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/geometry/transform.hpp>
#include <sidestep/plugin/context.hpp>
#include <sidestep/robot/head.hpp>

#include "simulator.hpp"

namespace sidestep::simulator {

/// The pose of the optical frame (z forward, x right, y down) of a camera at `position_m` that
/// looks at `look_at_m`, upright; looking straight up or down, the image's top is as if it had
/// turned there from looking along x.
[[nodiscard]] Transform look_at(const Eigen::Vector3d& position_m,
                                const Eigen::Vector3d& look_at_m);

/// What is wrong with the parameter `camera_path`: no waypoint, times that do not increase, a
/// waypoint that does not say in one way where the camera looks.
[[nodiscard]] std::vector<OptionMistake> check_camera_path(
    const std::vector<CameraWaypoint>& waypoints);

/// What is wrong with the parameter `fixed_cameras`: one that looks at where it is itself.
[[nodiscard]] std::vector<OptionMistake> check_fixed_cameras(
    const std::vector<FixedCamera>& cameras);

/// A camera's motion: position and look-at point on cubic Hermite splines whose velocity at a
/// waypoint is that from its predecessor to its successor and zero at both ends; orientations
/// given as angles by slerp. At rest before the first waypoint; after the last one at rest, or,
/// where the path repeats, at the first again.
class CameraPath {
 public:
  /// check_camera_path() must find nothing wrong with the waypoints.
  explicit CameraPath(std::vector<CameraWaypoint> waypoints, bool repeats = false)
      : waypoints_(std::move(waypoints)), repeats_(repeats) {}

  [[nodiscard]] Transform T_world_camera(double time_s) const;

 private:
  std::vector<CameraWaypoint> waypoints_;
  bool repeats_;
};

/// From where a camera looks at one time.
struct View {
  Transform T_world_camera = Transform::Identity();  ///< As it is known to be.
  Transform T_world_eye = Transform::Identity();     ///< As it truly is.
  std::vector<Transform> T_world_shape;              ///< Of the robot's shapes, truly.
  std::optional<Eigen::VectorXd> joint_positions;    ///< As measured.
};

/// The shapes of the run's robot that cameras see.
class SeenRobot {
 public:
  /// All shapes but those of the link `hidden`; -1 hides none.
  SeenRobot(std::shared_ptr<const RobotModel> robot, int hidden);
  /// Leaves out the shapes, too, that hold the sensor: what it is built into has a window for it.
  void look_out_of(std::span<const Transform> T_world_link, const Eigen::Vector3d& sensor_m);

  /// The shapes, anywhere; place() tells where.
  [[nodiscard]] std::vector<SceneObject> shapes() const;
  void place(std::span<const Transform> T_world_link, View& view) const;

 private:
  std::shared_ptr<const RobotModel> robot_;
  std::vector<int> seen_;  ///< Indices of the robot's shapes.
};

/// A camera on the run's robot, turned by its head where that carries it. It sees all shapes of
/// that robot but those of the link that carries it, and others inside which it sits.
class MountedCamera {
 public:
  /// Fails with kUnsupported where no robot moves in the run, with kConfig where the robot lacks
  /// the link.
  [[nodiscard]] static Result<MountedCamera> create(const MountOptions& options,
                                                    const HostContext& context);

  [[nodiscard]] const SeenRobot& robot() const { return *seen_; }

  /// The view at a time; nothing where the robot's state is not known then.
  [[nodiscard]] std::optional<View> view(Stamp stamp);

 private:
  MountedCamera() = default;
  [[nodiscard]] Result<void> mount(const MountOptions& options);
  [[nodiscard]] Result<int> find_link(const std::string& name) const;
  void place(const Eigen::VectorXd& q, const HeadAngles& head);

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<RobotMotion> motion_;
  int link_ = 0;
  Transform T_link_camera_ = Transform::Identity();
  std::optional<Head> head_;  ///< Where the robot has one.
  std::optional<SeenRobot> seen_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
};

/// Cameras that stand still and take frames in turn.
class FixedCameras {
 public:
  FixedCameras(const std::vector<FixedCamera>& cameras, const HostContext& context);

  /// The robot that they see; null where none moves in the run.
  [[nodiscard]] const SeenRobot* robot() const { return robot_ ? &*robot_ : nullptr; }
  /// The view of a frame; nothing where the robot's state is not known at its stamp.
  [[nodiscard]] std::optional<View> view(Stamp stamp, std::int64_t frame);

 private:
  std::vector<Transform> T_world_camera_;
  std::shared_ptr<const RobotModel> model_;
  std::shared_ptr<RobotMotion> motion_;
  std::optional<SeenRobot> robot_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
};

/// Where the camera of a frame is: on its path, on the robot, or fixed.
class Viewpoint {
 public:
  /// Fails as MountedCamera::create() does.
  [[nodiscard]] static Result<Viewpoint> create(const Options& options, const HostContext& context);

  /// The robot's shapes that may be seen.
  [[nodiscard]] std::vector<SceneObject> shapes() const;
  /// The view of a frame; nothing where it is not known.
  [[nodiscard]] std::optional<View> view(Stamp stamp, std::int64_t frame);
  /// The newest time at which the view may be known; before all time where it never was.
  [[nodiscard]] Stamp known_until() const;
  /// Whether a view that is not known now never will be.
  [[nodiscard]] bool is_past(Stamp stamp) const { return known_until() >= stamp; }

 private:
  /// The robot that is seen; null where none is.
  [[nodiscard]] const SeenRobot* robot() const;

  explicit Viewpoint(CameraPath path) : path_(std::move(path)) {}

  CameraPath path_;
  std::optional<MountedCamera> mounted_;                ///< Instead of the path.
  std::optional<FixedCameras> fixed_;                   ///< Instead of either.
  Transform T_optical_sensor_ = Transform::Identity();  ///< Of either.
  std::shared_ptr<RobotMotion> motion_;  ///< Of the robot in view; null where there is none.
};

}  // namespace sidestep::simulator
