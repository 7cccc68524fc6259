#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "path_judge.hpp"
#include "plain_search.hpp"

namespace sidestep::plain_driver {

/// A problem and what became of it.
struct Solve {
  std::string family;
  int index = 0;  ///< Within the family, as the set counts.
  PlainAnswer answer;
  PathVerdict verdict;  ///< Of a path that was found.
};

/// What solves come to, all together and then family by family, and the names of problems without
/// a path: `rows`, `unsolved`. Times, lengths and verdicts are those of the problems with one; the
/// state check is the mean over all.
[[nodiscard]] nlohmann::ordered_json summary_of(const std::vector<Solve>& solves, bool with_shapes);

/// The same for a terminal.
[[nodiscard]] std::string table_text(const nlohmann::ordered_json& summary);

}  // namespace sidestep::plain_driver
