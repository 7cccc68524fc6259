#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/node.hpp>

namespace sidestep {

/// One run of a sweep: where its files go, and what it has instead of what the configuration says.
struct SweepRun {
  std::string folder;  ///< Within that of the sweep, e.g. "02-experiment.seed=2".
  std::vector<std::pair<std::string, std::string>> values;  ///< Keys, and values as YAML.

  /// As `sidestep run` takes them after --set.
  [[nodiscard]] std::vector<std::string> overrides() const;
};

/// One configuration, run again and again with other values.
struct Sweep {
  std::string configuration;      ///< A file, or the name of an installed one.
  std::vector<std::string> keys;  ///< All that any run has values of.
  std::vector<SweepRun> runs;
};

/// Reads a sweep:
///
///     schema_version: 1
///     configuration: demo
///     grid:                        # every combination of these
///       experiment.seed: [1, 2, 3]
///       optimiser.plugin: [gp_chain, gp_ceres]
///     runs:                        # each with every one of these; may be left out, as the grid
///       - {mapper.resolution_m: 0.05}
///       - {mapper.resolution_m: 0.02, mapper.size_vox: [200, 200, 100]}
///
/// Fails with all that is wrong with it, at file:line:column.
[[nodiscard]] std::vector<Error> read_sweep(const std::filesystem::path& file,
                                            const DocumentReader& documents, Sweep& sweep);

}  // namespace sidestep
