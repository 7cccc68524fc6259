#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include <sidestep/core/node.hpp>
#include <sidestep/plugin/schema.hpp>

/// What an experiment writes into the blocks of plugins, beside what their configuration says.

namespace sidestep {

/// A scalar without quotes. [any]
[[nodiscard]] inline Node plain_scalar(std::string text, SourceMark mark) {
  return Node(Node::Scalar{std::move(text), false}, std::move(mark));
}

/// The map with one more entry, which was written where its value was. [any]
[[nodiscard]] inline Node with_entry(Node map, std::string key, Node value) {
  SourceMark mark = value.mark();
  map.entries().push_back({std::move(key), std::move(mark), std::move(value)});
  return map;
}

/// Whether a plugin has a parameter. [any]
[[nodiscard]] inline bool has_parameter(const Schema& schema, std::string_view name) noexcept {
  return std::ranges::find(schema, name, &Parameter::name) != schema.end();
}

}  // namespace sidestep
