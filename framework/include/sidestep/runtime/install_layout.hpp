#pragma once

#include <filesystem>

namespace sidestep {

/// Where an installation (or a build tree) keeps its parts, found from where the running
/// library lies, so that it may be moved.
struct InstallLayout {
  std::filesystem::path plugins;  ///< Shared libraries of plugins.
  std::filesystem::path robots;   ///< One folder a profile.
  std::filesystem::path configs;  ///< Experiments; scenes/ and parts/ below it.
};

/// `<prefix>/lib/libsidestep_runtime.so`: `<prefix>/lib/sidestep/plugins`,
/// `<prefix>/share/sidestep/{robots,configs}`. A build tree keeps libraries in `<build>/lib`,
/// plugins in `<build>/lib/sidestep/plugins`, and links `<build>/share/sidestep` to the sources.
[[nodiscard]] InstallLayout install_layout();

/// The same for a runtime library at a given place, e.g. /usr/lib/x86_64-linux-gnu/
/// libsidestep_runtime.so, whose prefix is /usr.
[[nodiscard]] InstallLayout install_layout_of(const std::filesystem::path& runtime_library);

}  // namespace sidestep
