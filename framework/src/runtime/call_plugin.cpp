#include <sidestep/runtime/call_plugin.hpp>

#include <exception>
#include <new>

#include <sidestep/planning/residual_names.hpp>
#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/runtime/host.hpp>

namespace sidestep {
namespace {

/// Calls into a plugin's object; an exception that escapes leaves as PluginThrew.
template <class Object, class Call>
std::invoke_result_t<Call> naming(const PluginPtr<Object>& object, Call&& call) {
  const PluginCall noted(plugin_of(object));
  try {
    return call();
  } catch (...) {
    throw PluginThrew(plugin_of(object), text_in_flight());
  }
}

class GuardedCost : public StateCost {
 public:
  explicit GuardedCost(PluginPtr<StateCost> cost) : cost_(std::move(cost)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return cost_->name(); }
  [[nodiscard]] int residual_count() const noexcept override { return cost_->residual_count(); }
  [[nodiscard]] bool depends_on_velocity() const noexcept override {
    return cost_->depends_on_velocity();
  }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const override {
    named([&] { cost_->evaluate(states, out, scratch); });
  }
  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch& scratch) const override {
    return named([&] { return cost_->linearise(states, range, out, scratch); });
  }

 protected:
  template <class Call>
  std::invoke_result_t<Call> named(Call&& call) const {
    return naming(cost_, std::forward<Call>(call));
  }

 private:
  PluginPtr<StateCost> cost_;
};

class GuardedNamingCost final : public GuardedCost, public NamesResiduals {
 public:
  GuardedNamingCost(PluginPtr<StateCost> cost, const NamesResiduals& names)
      : GuardedCost(std::move(cost)), names_(names) {}

  [[nodiscard]] ResidualName residual_name(int residual) const override {
    return named([&] { return names_.residual_name(residual); });
  }

 private:
  const NamesResiduals& names_;  ///< The cost itself.
};

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
    naming(robot_, std::forward<Call>(call));
  }

  PluginPtr<RobotModel> robot_;
};

}  // namespace

std::string text_in_flight() {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    return "out of memory";
  } catch (const std::exception& exception) {
    return exception.what();
  } catch (...) {
    return "something that is not a std::exception";
  }
}

Error error_in_flight(ErrorCode code, std::string where) {
  try {
    throw;
  } catch (const PluginThrew& threw) {
    return {ErrorCode::kPlugin,
            std::string("threw: ") + threw.what(),
            "plugin " + threw.plugin(),
            {},
            nullptr};
  } catch (...) {
    return {code, "threw: " + text_in_flight(), std::move(where), {}, nullptr};
  }
}

Error named_after(Error error, std::string_view plugin) {
  if (error.where.find(plugin) != std::string::npos) return error;
  error.where = std::string(plugin) + (error.where.empty() ? "" : ", " + error.where);
  return error;
}

PluginPtr<StateCost> guard_cost(PluginPtr<StateCost> cost) {
  PluginDeleter deleter{[](void* object) { delete static_cast<StateCost*>(object); },
                        plugin_of(cost)};
  const auto* names = dynamic_cast<const NamesResiduals*>(cost.get());
  StateCost* guarded = names != nullptr ? new GuardedNamingCost(std::move(cost), *names)
                                        : new GuardedCost(std::move(cost));
  return PluginPtr<StateCost>(guarded, std::move(deleter));
}

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
