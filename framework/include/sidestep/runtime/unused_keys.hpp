#pragma once

#include <string>
#include <vector>

#include <sidestep/plugin/schema.hpp>

namespace sidestep {

/// The schema of a block in one type of experiment, in which some of its keys have no effect.
struct UsedSchema {
  std::string type;                 ///< Of the experiment, for messages.
  Schema schema;                    ///< Without those keys.
  std::vector<std::string> unused;  ///< Those keys.
};

/// `schema` as an experiment of `type` uses it.
[[nodiscard]] UsedSchema used_schema(std::string type, Schema schema,
                                     std::vector<std::string> unused);

/// The map without what is of no use.
[[nodiscard]] Node used_part(Node map, const UsedSchema& used);

/// check_against_schema(), and a kConfig error of its own for each key of no use: what one sets is
/// not passed over in silence. A null, which takes back the value of a base configuration, is no
/// error.
void check_against_used(const Node& map, const UsedSchema& used, std::vector<Error>& errors);

}  // namespace sidestep
