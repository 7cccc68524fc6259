#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace sidestep {

/// A plugin of Sidestep's own that was left out of a build: what it needs was not installed, or
/// only some plugins were asked for.
struct NotBuiltPlugin {
  std::string kind;  ///< "source", "mapper", ...
  std::string name;
  /// What to install before building again, with blanks between them; empty: build it.
  std::string packages;
  friend bool operator==(const NotBuiltPlugin&, const NotBuiltPlugin&) = default;
};

/// Those that the builds in these folders left out, as not_built.txt beside the plugins says, `KIND
/// NAME PACKAGE...` a line, and those that they may have left out, as configured.txt does, `KIND
/// NAME`. Folders without such files, and lines that are none, are passed over. [any]
[[nodiscard]] std::vector<NotBuiltPlugin> plugins_not_built(
    const std::vector<std::filesystem::path>& plugin_paths);

/// What to do to have the plugin, one sentence without a full stop.
[[nodiscard]] std::string how_to_build(const NotBuiltPlugin& plugin);

}  // namespace sidestep
