#include <sidestep/runtime/not_built.hpp>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <utility>

namespace sidestep {

std::vector<NotBuiltPlugin> plugins_not_built(
    const std::vector<std::filesystem::path>& plugin_paths) {
  std::vector<NotBuiltPlugin> plugins;
  for (const auto& folder : plugin_paths) {
    for (const char* list : {"not_built.txt", "configured.txt"}) {
      std::ifstream file(folder / list);
      for (std::string line; std::getline(file, line);) {
        std::istringstream words(line);
        NotBuiltPlugin plugin;
        if (!(words >> plugin.kind >> plugin.name)) continue;
        std::getline(words >> std::ws, plugin.packages);
        if (std::ranges::find(plugins, plugin) == plugins.end()) {
          plugins.push_back(std::move(plugin));
        }
      }
    }
  }
  return plugins;
}

std::string how_to_build(const NotBuiltPlugin& plugin) {
  if (plugin.packages.empty()) {
    return "'" + plugin.name +
           "' is not built yet: `tools/run.sh CONFIGURATION` builds what a configuration names, "
           "`tools/build.sh` everything";
  }
  if (plugin.packages.starts_with("sidestep-")) {  // Sidestep itself was installed as packages
    return "'" + plugin.name + "' is in another package: `sudo apt install " + plugin.packages +
           "`";
  }
  return "'" + plugin.name + "' was not built: `sudo apt install " + plugin.packages +
         "`, then build again";
}

}  // namespace sidestep
