#pragma once

#include <set>
#include <string>
#include <vector>

#include <sidestep/plugin/parameters.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// Reads a block into a struct with parameters; false where it does not fit its schema, whose check
/// tells.
template <class Entry>
[[nodiscard]] bool read_entry(const Node& block, Entry& entry) {
  std::vector<Error> told;
  if (!block.is_map()) return false;
  const auto parameters = Entry::parameters();
  check_against_schema(block, parameters.schema(), {}, told);
  if (told.empty()) parameters.read(block, entry, told);
  return told.empty();
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
