#pragma once

#include <memory>
#include <vector>

#include <sidestep/plugin/map_options.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace as_last_seen {

/// What all mappers on a grid have: its voxels, ranges, the floor rule.
struct Options : sidestep::MapOptions {
  static sidestep::Parameters<Options> parameters() {
    return sidestep::declare_measurement(sidestep::declare_grid(sidestep::Parameters<Options>()));
  }

  /// Four bits a voxel.
  [[nodiscard]] std::vector<sidestep::OptionMistake> check() const {
    return sidestep::check_map_options(*this, sidestep::voxels_of_blocks(*this) / 2.0 / 1048576.0);
  }
};

/// What the host calls, and the tests.
sidestep::Result<std::unique_ptr<sidestep::Mapper>> create(const Options& options,
                                                           const sidestep::HostContext& context);

}  // namespace as_last_seen
