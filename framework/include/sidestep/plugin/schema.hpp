#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>

namespace sidestep {

enum class PluginKind : std::uint32_t {
  kSource = 1,
  kMapper = 2,
  kField = 3,
  kRobot = 4,
  kOptimiser = 5,
  kExecutor = 6,
  kCost = 7,
  kExperiment = 8,
  kPredictor = 9,
  kGaze = 10,
  kLocaliser = 11,
};
[[nodiscard]] std::string_view to_string(PluginKind kind) noexcept;  ///< "source", "mapper", ...

enum class ParameterType {
  kBool,
  kInt,
  kDouble,
  kString,
  kPath,
  kChoice,
  kDoubles,
  kInts,
  kStrings,
  kObject,   ///< A map with parameters of its own.
  kObjects,  ///< A list of such maps.
  kNode,     ///< Any structure; the code that reads it checks it.
};
[[nodiscard]] std::string_view to_string(ParameterType type) noexcept;

/// One parameter, as declared. Everything that is shown or checked comes from here.
struct Parameter {
  std::string name;
  ParameterType type = ParameterType::kNode;
  std::string unit;          ///< "m", "s", ...; empty for none.
  std::string doc;           ///< One sentence.
  std::string default_text;  ///< As one would write it in a file; empty if required.
  bool required = false;
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  std::vector<std::string> choices;
  std::optional<std::size_t> size;    ///< Of a list; nothing for any length.
  std::vector<Parameter> parameters;  ///< Of an object, or of each object of a list.
  std::optional<PluginKind> plugin;   ///< Of a structure that is a plugin's block: its kind.
  /// Parameters of that plugin that its owner sets, and checks with the block.
  std::vector<std::string> set_by_owner;
};

using Schema = std::vector<Parameter>;

/// Checks a map against a schema: unknown and missing keys, types, ranges, choices, NaN and
/// infinities, at every depth. Appends one kConfig error per mistake, with position and the
/// nearest valid name. Keys in `also_allowed` are the caller's own.
void check_against_schema(const Node& map, const Schema& schema,
                          const std::vector<std::string>& also_allowed, std::vector<Error>& errors);

/// A mistake that no parameter shows on its own, e.g. a lower limit above its upper one.
struct OptionMistake {
  /// Those concerned, as "l_min" or "filters[1].crop": the message names the first, its position is
  /// that of the first that is written in the configuration.
  std::vector<std::string> parameters;
  std::string what;  ///< Goes on after the name: "must be below l_max".
  std::string hint;  ///< What to do about it; may be empty.
};

/// Appends each mistake in the options that `map` holds as a kConfig error with its position.
void report_mistakes(const Node& map, const std::vector<OptionMistake>& mistakes,
                     std::vector<Error>& errors);

}  // namespace sidestep
