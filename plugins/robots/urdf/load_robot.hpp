#pragma once

#include <memory>

#include <sidestep/plugin/plugin.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep::urdf_robot {

/// What a configuration says of its robot.
struct Options {
  Node profile;
  std::filesystem::path urdf;
  std::optional<std::string> base;
  std::string root_link;
  std::string tip_link;
  std::vector<std::string> joints;
  Node joint_limits;
  Node fixed_joints;
  Node package_paths;
  double sphere_protrusion_m = 0.05;
  static Parameters<Options> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// A robot from a profile, or from a URDF as it is. options.check() must find nothing wrong.
[[nodiscard]] Result<std::unique_ptr<KinematicTree>> load_robot(const Options& options,
                                                                const HostContext& context);

}  // namespace sidestep::urdf_robot
