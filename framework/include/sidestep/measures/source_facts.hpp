#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include <sidestep/runtime/host.hpp>

namespace sidestep {

/// The scene behind a source's frames; null where it is not known. Fails where the source throws.
[[nodiscard]] Result<std::shared_ptr<const Scene>> true_scene(const PluginPtr<Source>& source);

/// How many frames a source has; nothing where it cannot be known. Fails where the source throws.
[[nodiscard]] Result<std::optional<std::int64_t>> frame_count_of(const PluginPtr<Source>& source);

}  // namespace sidestep
