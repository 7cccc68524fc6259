#include "load_robot.hpp"

namespace {

sidestep::Result<std::unique_ptr<sidestep::RobotModel>> create(
    const sidestep::urdf_robot::Options& options, const sidestep::HostContext& context) {
  auto robot = SIDESTEP_TRY(sidestep::urdf_robot::load_robot(options, context));
  return std::unique_ptr<sidestep::RobotModel>(std::move(robot));
}

}  // namespace

SIDESTEP_PLUGIN(sidestep::RobotModel, sidestep::urdf_robot::Options, create, "urdf", "0.1.0",
                "A robot from a URDF, with its spheres, limits and poses from a profile")
