#pragma once

#include <memory>
#include <string>
#include <vector>

#include <sidestep/planning/residual_names.hpp>
#include <sidestep/planning/state_cost.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace keep_side {

struct Options {
  std::string link;
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double sigma_m = 0.01;

  static sidestep::Parameters<Options> parameters();
  [[nodiscard]] std::vector<sidestep::OptionMistake> check() const;
};

/// One residual: how far the link's origin is behind the plane, over sigma; none in front of it.
class KeepSide final : public sidestep::StateCost, public sidestep::NamesResiduals {
 public:
  KeepSide(std::shared_ptr<const sidestep::RobotModel> robot, int link, const Options& options);

  [[nodiscard]] std::string_view name() const noexcept override { return name_; }
  [[nodiscard]] int residual_count() const noexcept override { return 1; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  void evaluate(const sidestep::StateBatch& states, const sidestep::CostBatch& out,
                sidestep::Scratch& scratch) const override;
  [[nodiscard]] sidestep::ResidualName residual_name(int residual) const override;

 private:
  std::shared_ptr<const sidestep::RobotModel> robot_;
  int link_;
  std::string name_;
  Eigen::Vector3d point_m_;
  Eigen::Vector3d normal_;
  double sigma_m_;
};

sidestep::Result<std::unique_ptr<sidestep::StateCost>> create(const Options& options,
                                                              const sidestep::HostContext& context);

}  // namespace keep_side
