#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>

namespace sidestep {

/// One experiment's configuration: a file, the `base:` files it builds on, and overrides from
/// the command line, merged into one document in which every value knows its origin.
struct Configuration {
  std::string name;  ///< The file's stem.
  std::filesystem::path file;
  Node root;
};

/// A top-level block of a configuration; a null node where it has none.
[[nodiscard]] inline const Node& block_of(const Configuration& configuration,
                                          std::string_view name) {
  static const Node kNothing;
  const Node* block = configuration.root.find(name);
  return block != nullptr ? *block : kNothing;
}

struct ConfigurationReading {
  Configuration configuration;
  std::vector<Error> errors;
};

/// Reads and merges. `base: FILE` (or a list, later ones win) is read first and overridden key
/// by key; `overrides` are "a.b=value" with YAML values and override both. A block that names
/// another `plugin` than its base starts afresh: the base's parameters belong to the other
/// plugin. Checks schema_version and the top-level keys; blocks are checked by Host and by the
/// experiment. All mistakes in one pass.
[[nodiscard]] ConfigurationReading read_configuration(const std::filesystem::path& file,
                                                      const std::vector<std::string>& overrides,
                                                      const DocumentReader& documents);

}  // namespace sidestep
