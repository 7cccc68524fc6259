#include <sidestep/runtime/unused_keys.hpp>

#include <algorithm>

namespace sidestep {
namespace {

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

std::string known_keys(const Schema& schema) {
  std::string text = "known keys:";
  for (const Parameter& parameter : schema) {
    text += (&parameter == &schema.front() ? " " : ", ") + parameter.name;
  }
  return text;
}

}  // namespace

UsedSchema used_schema(std::string type, Schema schema, std::vector<std::string> unused) {
  std::erase_if(schema,
                [&](const Parameter& parameter) { return contains(unused, parameter.name); });
  return {std::move(type), std::move(schema), std::move(unused)};
}

Node used_part(Node map, const UsedSchema& used) {
  if (!map.is_map()) return map;
  std::erase_if(map.entries(),
                [&](const Node::Entry& entry) { return contains(used.unused, entry.key); });
  return map;
}

void check_against_used(const Node& map, const UsedSchema& used, std::vector<Error>& errors) {
  check_against_schema(used_part(map, used), used.schema, {}, errors);
  for (const Node::Entry& entry : map.entries()) {
    if (entry.value.is_null() || !contains(used.unused, entry.key)) continue;
    errors.push_back(entry.value.error(
        "'" + entry.key + "' has no effect in an experiment of type '" + used.type + "'",
        known_keys(used.schema)));
  }
}

}  // namespace sidestep
