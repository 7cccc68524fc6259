#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include <sidestep/plugin/descriptor.hpp>

namespace sidestep {

/// Opens a library and returns its plugins' descriptors, at least one, once everything about them
/// has been found to fit this host. The library stays loaded for good. Fails with kPlugin, saying
/// what does not fit and what to do.
[[nodiscard]] Result<std::vector<const PluginDescriptor*>> open_plugin_library(
    const std::filesystem::path& library);

/// The parameters that an opened plugin declares. Fails with kPlugin where the plugin throws.
[[nodiscard]] Result<Schema> read_schema(const PluginDescriptor& plugin,
                                         const std::filesystem::path& library);

/// The interface version that this host speaks; nothing for a kind it does not know.
[[nodiscard]] std::optional<std::uint32_t> interface_version(PluginKind kind) noexcept;

}  // namespace sidestep
