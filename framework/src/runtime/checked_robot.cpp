#include <sidestep/runtime/checked_robot.hpp>

#include <sidestep/runtime/configuration.hpp>

namespace sidestep {

std::shared_ptr<const RobotModel> checked_robot(const Configuration& configuration, Host& host,
                                                std::vector<Error>& errors) {
  const Node& block = block_of(configuration, "robot");
  if (block.is_null()) return nullptr;
  std::vector<Error> told;
  host.check(PluginKind::kRobot, block, told);
  if (!told.empty()) return nullptr;
  auto robot = host.create<RobotModel>(block);
  if (robot) return std::move(*robot);
  errors.push_back(std::move(robot.error()));
  return nullptr;
}

}  // namespace sidestep
