#pragma once

#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sidestep/plugin/parameters.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/configuration.hpp>

namespace sidestep {

/// Reads a block into a struct with parameters; false where it does not fit its schema, whose check
/// tells. Appends what fits the schema and yet cannot be read, e.g. a number too large.
template <class Entry>
[[nodiscard]] bool read_entry(const Node& block, Entry& entry, std::vector<Error>& errors) {
  std::vector<Error> told;
  const auto parameters = Entry::parameters();
  check_against_schema(block, parameters.schema(), {}, told);
  if (told.empty()) parameters.read(block, entry, errors);
  return told.empty();
}
/// The same; false where anything cannot be read.
template <class Entry>
[[nodiscard]] bool read_entry(const Node& block, Entry& entry) {
  std::vector<Error> errors;
  return read_entry(block, entry, errors) && errors.empty();
}

/// A block of a configuration that has passed its check; as by default where there is none. Fails
/// with the first value that cannot be read.
template <class Settings>
[[nodiscard]] Result<Settings> read_block(const Configuration& configuration,
                                          std::string_view name) {
  Settings settings;
  std::vector<Error> errors;
  Settings::parameters().read(block_of(configuration, name), settings, errors);
  if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
  return settings;
}

template <class Named>
[[nodiscard]] std::vector<std::string> names_of(const std::vector<Named>& items) {
  std::vector<std::string> names;
  for (const Named& item : items) names.push_back(item.name);
  return names;
}

/// `what 'name'`, with the nearest of the names that would do.
[[nodiscard]] inline Error unknown_name(const std::string& what, const std::string& name,
                                        const std::string& where,
                                        const std::vector<std::string>& names) {
  return {ErrorCode::kConfig, what + " '" + name + "'", where, did_you_mean(name, names), nullptr};
}

/// Takes down the name of a list's item, e.g. "a plan"; appends a mistake where one before it has
/// it.
inline void take_name(const Node& name, const std::string& what, std::set<std::string>& taken,
                      std::vector<Error>& errors) {
  if (taken.insert(name.text()).second) return;
  errors.push_back(name.error(what + " before this one is named '" + name.text() + "', too"));
}

/// Whether a robot has the link that a node names; appends a mistake where it does not.
[[nodiscard]] inline bool has_link(const RobotDescription& robot, const Node& name,
                                   std::vector<Error>& errors) {
  if (robot.link_index(name.text())) return true;
  errors.push_back(unknown_name("robot '" + robot.name + "' has no link", name.text(),
                                name.mark().to_string(), names_of(robot.links)));
  return false;
}

}  // namespace sidestep
