#pragma once

#include <memory>
#include <string>
#include <vector>

#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/task_settings.hpp>

namespace sidestep {

/// An item of `costs` of a plan: a cost that a plugin makes.
struct PluginCostEntry {
  Node cost;
  std::string at = "support_and_interpolated";
  bool frees_goal = false;

  static Parameters<PluginCostEntry> parameters();
};

/// Adds the costs that an item of `experiment.plans` has from plugins to its task. Appends what is
/// wrong with each; passes over what its schema refuses.
void read_plugin_costs(const Node& plan, const std::shared_ptr<const RobotModel>& robot, Host& host,
                       Task& task, std::vector<Error>& errors);

}  // namespace sidestep
