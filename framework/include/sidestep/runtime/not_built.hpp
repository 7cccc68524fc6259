#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace sidestep {

/// A plugin of Sidestep's own that was left out of a build, for what it needs was not installed.
struct NotBuiltPlugin {
  std::string kind;  ///< "source", "mapper", ...
  std::string name;
  std::string packages;  ///< What to install before building again, with blanks between them.
  friend bool operator==(const NotBuiltPlugin&, const NotBuiltPlugin&) = default;
};

/// Those that the builds in these folders left out, as a file not_built.txt beside the plugins
/// says, `KIND NAME PACKAGE...` a line. Folders without such a file, and lines that are none, are
/// passed over. [any]
[[nodiscard]] std::vector<NotBuiltPlugin> plugins_not_built(
    const std::vector<std::filesystem::path>& plugin_paths);

/// What to do to have the plugin, one sentence without a full stop.
[[nodiscard]] std::string how_to_build(const NotBuiltPlugin& plugin);

}  // namespace sidestep
