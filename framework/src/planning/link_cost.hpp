#pragma once

#include <memory>
#include <string>
#include <utility>

#include <sidestep/planning/residual_names.hpp>
#include <sidestep/planning/state_cost.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// A cost of where one link is: residuals that are functions of the link's pose alone.
class LinkCost : public StateCost, public NamesResiduals {
 public:
  [[nodiscard]] std::string_view name() const noexcept final { return name_; }
  [[nodiscard]] bool depends_on_velocity() const noexcept final { return false; }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const final;

 protected:
  LinkCost(std::string name, std::shared_ptr<const RobotModel> robot, int link)
      : name_(std::move(name)), robot_(std::move(robot)), link_(link) {}

  [[nodiscard]] const std::shared_ptr<const RobotModel>& robot() const noexcept { return robot_; }
  [[nodiscard]] int link() const noexcept { return link_; }
  [[nodiscard]] const std::string& link_name() const noexcept {
    return robot_->description().links[static_cast<std::size_t>(link_)].name;
  }

  /// Residuals at a pose and, of each, the derivative by the link's motion: `force` by the velocity
  /// of the link's point that is at the world's origin, `moment` by its angular velocity.
  virtual void measure(const Transform& T_world_link, std::span<double> residuals,
                       std::span<LinkForce> derivatives) const noexcept = 0;

 private:
  std::string name_;
  std::shared_ptr<const RobotModel> robot_;
  int link_;
};

}  // namespace sidestep
