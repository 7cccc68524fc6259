#pragma once

#include <string_view>

#include <sidestep/runtime/configuration.hpp>

namespace sidestep {

/// A top-level block of a configuration; a null node where it has none.
[[nodiscard]] inline const Node& block_of(const Configuration& configuration,
                                          std::string_view name) {
  static const Node kNothing;
  const Node* block = configuration.root.find(name);
  return block != nullptr ? *block : kNothing;
}

}  // namespace sidestep
