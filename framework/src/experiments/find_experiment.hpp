#pragma once

#include <string>
#include <vector>

#include <sidestep/runtime/experiment.hpp>

namespace sidestep {

/// An experiment, and the plugin that it is.
struct FoundExperiment {
  PluginInfo plugin;
  PluginPtr<Experiment> experiment;

  [[nodiscard]] const std::string& name() const noexcept { return plugin.name; }
};

/// Every experiment that the host has, by name. Fails where one cannot be created.
[[nodiscard]] Result<std::vector<FoundExperiment>> find_experiments(Host& host);

/// The experiment that a block `{type: NAME}` names. Fails as Host::find() does, but with kConfig.
[[nodiscard]] Result<FoundExperiment> find_experiment(const Node& block, Host& host);
/// The same by name alone; `where` stands in errors.
[[nodiscard]] Result<FoundExperiment> find_experiment(const std::string& name,
                                                      const std::string& where, Host& host);

}  // namespace sidestep
