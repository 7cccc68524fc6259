#pragma once

#include <filesystem>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/geometry/scene.hpp>

namespace sidestep {

/// Reads the scene that `scene` names: a file, with or without `.yaml`, or else one of that name
/// in one of the folders. Fails with kNotFound, naming what was tried and what there is, or with
/// kConfig, each mistake the cause of the one before. [any]
[[nodiscard]] SIDESTEP_EXPORT Result<Scene> load_scene(
    const std::filesystem::path& scene, const std::vector<std::filesystem::path>& folders,
    const DocumentReader& documents);

}  // namespace sidestep
