#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <sidestep/core/scratch.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/plugin/context.hpp>

#include "head.hpp"
#include "options.hpp"

namespace sidestep::simulator {

/// From where a camera looks at one time.
struct View {
  Transform T_world_camera = Transform::Identity();  ///< As it is known to be.
  Transform T_world_eye = Transform::Identity();     ///< As it truly is.
  std::vector<Transform> T_world_shape;              ///< Of the robot's shapes, truly.
  std::optional<Eigen::VectorXd> joint_positions;    ///< As measured.
};

/// A camera on the run's robot, and the shapes of that robot that it may see: all but those of the
/// link that carries it, inside which it may sit.
class MountedCamera {
 public:
  /// Fails with kUnsupported where no robot moves in the run, with kConfig where the robot lacks a
  /// link or a joint.
  [[nodiscard]] static Result<MountedCamera> create(const MountOptions& options,
                                                    const HostContext& context);

  /// The shapes that it may see, anywhere; view() tells where.
  [[nodiscard]] std::vector<SceneObject> shapes() const;

  /// The view at a time; nothing where the robot's state is not known then. Times go forward: the
  /// head turns from one to the next.
  [[nodiscard]] std::optional<View> view(Stamp stamp);

  /// The newest time at which the robot's state is known.
  [[nodiscard]] std::optional<Stamp> newest() const { return motion_->newest(); }

 private:
  MountedCamera() = default;
  [[nodiscard]] Result<void> mount(const MountOptions& options);
  [[nodiscard]] Result<int> find_link(const std::string& name) const;
  void place(const Eigen::VectorXd& q, std::vector<Transform>& T_world_link);
  void aim(const RobotState& measured, Stamp stamp);
  void follow_motion(const RobotState& measured, Stamp stamp);

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<RobotMotion> motion_;
  HeadOptions options_;
  Eye eye_;
  int base_link_ = 0;
  int ahead_link_ = 0;
  std::optional<Head> head_;  ///< Where it turns.
  std::vector<int> seen_;     ///< Indices of the robot's shapes.
  std::vector<Transform> T_world_link_;
  std::vector<Transform> T_world_link_later_;
  Scratch scratch_;
};

}  // namespace sidestep::simulator
