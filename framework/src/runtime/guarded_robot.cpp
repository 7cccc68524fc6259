#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/runtime/host.hpp>

namespace sidestep {
namespace {

class GuardedRobot final : public RobotModel {
 public:
  explicit GuardedRobot(PluginPtr<RobotModel> robot) : robot_(std::move(robot)) {}

  const RobotDescription& description() const noexcept override { return robot_->description(); }

  void link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                  Scratch& scratch) const override {
    named([&] { robot_->link_poses(q, T_world_link, scratch); });
  }
  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      Scratch& scratch) const override {
    named([&] { robot_->sphere_centres(q, centres_m, scratch); });
  }
  void sphere_centre_lanes(std::span<const double> q, std::span<PointLanes> centres_m,
                           Scratch& scratch) const override {
    named([&] { robot_->sphere_centre_lanes(q, centres_m, scratch); });
  }
  void sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const override {
    named([&] { robot_->sphere_jacobians(q, centres_m, jacobians, scratch); });
  }
  void pull_back(std::span<const double> q, std::span<const LinkForce> forces,
                 std::span<double> joint_forces, Scratch& scratch) const override {
    named([&] { robot_->pull_back(q, forces, joint_forces, scratch); });
  }

 private:
  template <class Call>
  void named(Call&& call) const {
    try {
      call();
    } catch (...) {
      throw PluginThrew(plugin_of(robot_), text_in_flight());
    }
  }

  PluginPtr<RobotModel> robot_;
};

}  // namespace

PluginPtr<RobotModel> guard_robot(PluginPtr<RobotModel> robot) {
  // The framework's own and final: none of the plugin's code runs in it, and objects can be
  // attached.
  if (dynamic_cast<const KinematicTree*>(robot.get()) != nullptr) return robot;
  std::string plugin = plugin_of(robot);
  return PluginPtr<RobotModel>(
      new GuardedRobot(std::move(robot)),
      PluginDeleter{[](void* object) { delete static_cast<RobotModel*>(object); },
                    std::move(plugin)});
}

}  // namespace sidestep
