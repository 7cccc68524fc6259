#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <string_view>

#include <sidestep/trajectory/robot_motion.hpp>

#include "conformance/manual_clock.hpp"
#include "simulator_testing.hpp"
#include "support/hsr.hpp"

namespace sidestep::simulator::testing {

/// The HSR, a history of its states that a test writes, and a host that lends both.
class HsrOnItsWay {
 public:
  HsrOnItsWay() : robot_(testing_support::load_hsr()) {
    conformance::TestHostParts parts = host_parts();
    parts.robot = robot_;
    parts.motion = motion_;
    parts.clock = &clock_;
    host_ = std::make_unique<conformance::TestHost>(2, parts);
  }

  [[nodiscard]] const RobotDescription& description() const { return robot_->description(); }
  [[nodiscard]] int joint(const std::string& name) const {
    return *description().joint_index(name);
  }
  /// A named pose with the base at the origin.
  [[nodiscard]] Eigen::VectorXd pose(const std::string& name) const {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(description().dof());
    const auto& positions = description().find_pose(name)->positions;
    for (int j = 0; j < q.size(); ++j) q[j] = positions[static_cast<std::size_t>(j)].value_or(0.0);
    return q;
  }
  [[nodiscard]] std::vector<Transform> links(const Eigen::VectorXd& q) const {
    std::vector<Transform> poses(description().links.size());
    Scratch scratch;
    robot_->link_poses({q.data(), static_cast<std::size_t>(q.size())}, poses, scratch);
    return poses;
  }
  [[nodiscard]] const Transform& link(const std::vector<Transform>& poses,
                                      const std::string& name) const {
    return poses[static_cast<std::size_t>(*description().link_index(name))];
  }
  /// The distance of a point from the surfaces of the robot's shapes, but those of one link.
  [[nodiscard]] double distance_m(const Eigen::Vector3d& p_world, const Eigen::VectorXd& q,
                                  std::string_view but_link = {}) const {
    const std::vector<Transform> poses = links(q);
    const auto but = description().link_index(but_link);
    double nearest_m = std::numeric_limits<double>::infinity();
    for (const CollisionShape& shape : description().shapes) {
      if (shape.link == but) continue;
      const Transform pose = poses[static_cast<std::size_t>(shape.link)] * shape.T_link_shape;
      nearest_m =
          std::min(nearest_m, std::abs(signed_distance_m(shape.shape, pose.inverse() * p_world)));
    }
    return nearest_m;
  }
  /// Moves from `q` on at a constant velocity, measured every 10 ms from `from_s` to `to_s`.
  void move(const Eigen::VectorXd& q, const Eigen::VectorXd& qdot, double from_s, double to_s) {
    const int last = static_cast<int>(std::lround((to_s - from_s) * 100.0));
    for (int i = 0; i <= last; ++i) {
      motion_->record({q + qdot * (0.01 * i), qdot}, Stamp::from_seconds(from_s + 0.01 * i));
    }
  }

  [[nodiscard]] const std::shared_ptr<const RobotModel>& robot() const { return robot_; }
  [[nodiscard]] RobotMotion& motion() { return *motion_; }
  [[nodiscard]] conformance::ManualClock& clock() { return clock_; }
  [[nodiscard]] HostContext context() { return host_->context(1); }

  /// An image of 160 x 120 pixels, with the field of view of the HSR's camera.
  [[nodiscard]] static Options options(const std::filesystem::path& scene) {
    Options options;
    options.scene = scene;
    options.frames = 0;
    options.rate_hz = 10.0;
    options.camera = {160, 120, 138.6, 138.6, 79.5, 59.5};
    options.mount = MountOptions{.link = "head_rgbd_sensor_link"};
    return options;
  }

 private:
  std::shared_ptr<const RobotModel> robot_;
  conformance::ManualClock clock_;
  std::shared_ptr<RobotMotion> motion_ = std::make_shared<RobotMotion>(100.0);
  std::unique_ptr<conformance::TestHost> host_;
};

}  // namespace sidestep::simulator::testing
