#pragma once

#include <memory>
#include <vector>

#include <sidestep/plugin/plugin.hpp>

namespace scissor_lift {

struct Options {
  double arm_m = 0.5;
  int stages = 2;
  double load_radius_m = 0.3;
  double range_m = 10.0;
  double max_velocity_mps = 0.6;
  double max_acceleration_mps2 = 0.6;

  static sidestep::Parameters<Options> parameters();
  [[nodiscard]] std::vector<sidestep::OptionMistake> check() const;
};

/// Crossed arms, in stages one above the other, lift a platform that stays level. Their height goes
/// with the sine of one angle, which no tree of joints can tell. The base goes along x and y.
class ScissorLift final : public sidestep::RobotModel {
 public:
  explicit ScissorLift(const Options& options);

  [[nodiscard]] const sidestep::RobotDescription& description() const noexcept override {
    return description_;
  }
  void link_poses(std::span<const double> q, std::span<sidestep::Transform> T_world_link,
                  sidestep::Scratch& scratch) const override;
  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      sidestep::Scratch& scratch) const override;
  void sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        std::span<Eigen::Vector3d> jacobians,
                        sidestep::Scratch& scratch) const override;
  void pull_back(std::span<const double> q, std::span<const sidestep::LinkForce> forces,
                 std::span<double> joint_forces, sidestep::Scratch& scratch) const override;

 private:
  [[nodiscard]] Eigen::Vector3d origin_m(const double* q, int link) const;
  /// What a link rises by as the arms are raised by a radian.
  [[nodiscard]] double rise(const double* q, int link) const;

  double arm_m_;
  std::vector<double> stages_below_;  ///< Per link; the arms of a stage cross in its middle.
  sidestep::RobotDescription description_;
};

/// What the host calls.
sidestep::Result<std::unique_ptr<sidestep::RobotModel>> create(
    const Options& options, const sidestep::HostContext& context);

}  // namespace scissor_lift
