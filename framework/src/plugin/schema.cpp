#include <sidestep/plugin/parameters.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>

namespace sidestep {
namespace {

std::string range_text(const Parameter& parameter) {
  const std::string unit = parameter.unit.empty() ? "" : " " + parameter.unit;
  const bool has_min = std::isfinite(parameter.min);
  const bool has_max = std::isfinite(parameter.max);
  if (has_min && has_max) {
    return "between " + detail::number_text(parameter.min) + " and " +
           detail::number_text(parameter.max) + unit;
  }
  return (has_min ? "at least " + detail::number_text(parameter.min)
                  : "at most " + detail::number_text(parameter.max)) +
         unit;
}

/// What "a.b[2].c" names, or the deepest of its parts that is written; null where not even the
/// first is.
const Node* find_path(const Node& map, std::string_view path) {
  const Node* found = nullptr;
  const Node* at = &map;
  while (!path.empty()) {
    const std::size_t end = path.find_first_of(".[]", 1);
    const std::string_view part = path.substr(0, end);
    if (part.front() == '[') {
      std::size_t index = 0;
      std::from_chars(part.data() + 1, part.data() + part.size(), index);
      at = index < at->items().size() ? &at->items()[index] : nullptr;
    } else {
      at = at->find(part);
    }
    if (at == nullptr) return found;
    found = at;
    path.remove_prefix(part.size());
    if (path.starts_with(']')) path.remove_prefix(1);
    if (path.starts_with('.')) path.remove_prefix(1);
  }
  return found;
}

/// Checks one map at one depth, and what lies below it.
class Checker {
 public:
  explicit Checker(std::vector<Error>& errors) : errors_(errors) {}

  void check_map(const Node& map, const Schema& schema, const std::string& path,
                 const std::vector<std::string>& also_allowed) {
    for (const Node::Entry& entry : map.entries()) {
      if (std::ranges::find(also_allowed, entry.key) != also_allowed.end()) continue;
      const auto parameter = std::ranges::find(schema, entry.key, &Parameter::name);
      if (parameter == schema.end()) {
        unknown_key(entry, schema, path, also_allowed);
      } else {
        check_value(entry.value, *parameter, path + entry.key);
      }
    }
    for (const Parameter& parameter : schema) {
      const Node* value = map.find(parameter.name);
      if (parameter.required && (value == nullptr || value->is_null())) {
        errors_.push_back(map.error("'" + path + parameter.name + "' is missing", parameter.doc));
      }
    }
  }

 private:
  void unknown_key(const Node::Entry& entry, const Schema& schema, const std::string& path,
                   const std::vector<std::string>& also_allowed) {
    std::vector<std::string> names = also_allowed;
    std::ranges::transform(schema, std::back_inserter(names), &Parameter::name);
    errors_.push_back(Error{
        ErrorCode::kConfig, "unknown key '" + path + entry.key + "'", entry.key_mark.to_string(),
        did_you_mean(entry.key, names, "known keys: " + joined(names)), nullptr});
  }

  void complain(const Node& node, const std::string& path, const std::string& message,
                std::string hint = {}) {
    errors_.push_back(node.error("'" + path + "': " + message, std::move(hint)));
  }

  template <class T>
  bool expect(const Result<T>& value, const Node& node, const std::string& path) {
    if (!value) complain(node, path, value.error().message);
    return value.has_value();
  }

  void check_range(const Node& node, double value, const Parameter& parameter,
                   const std::string& path) {
    if (value < parameter.min || value > parameter.max) {
      complain(node, path, node.text() + " is out of range", "expected " + range_text(parameter));
    }
  }

  void check_value(const Node& node, const Parameter& parameter, const std::string& path) {
    // Left open: the default; a missing one is reported elsewhere.
    if (!node.is_null()) check_present(node, parameter, path);
  }

  void check_present(const Node& node, const Parameter& parameter, const std::string& path) {
    switch (parameter.type) {
      case ParameterType::kNode: return;
      case ParameterType::kBool: expect(node.as_bool(), node, path); return;
      case ParameterType::kInt:
        if (const auto value = node.as_int(); expect(value, node, path)) {
          check_range(node, static_cast<double>(*value), parameter, path);
        }
        return;
      case ParameterType::kDouble:
        if (const auto value = node.as_double(); expect(value, node, path)) {
          check_range(node, *value, parameter, path);
        }
        return;
      case ParameterType::kString:
      case ParameterType::kPath: expect(node.as_string(), node, path); return;
      case ParameterType::kChoice: check_choice(node, parameter, path); return;
      case ParameterType::kDoubles:
      case ParameterType::kInts:
      case ParameterType::kStrings:
      case ParameterType::kObjects: check_list(node, parameter, path); return;
      case ParameterType::kObject:
        if (!node.is_map()) {
          complain(node, path, "expected a map, found " + node.kind());
        } else {
          check_map(node, parameter.parameters, path + ".", {});
        }
        return;
    }
  }

  void check_choice(const Node& node, const Parameter& parameter, const std::string& path) {
    if (!expect(node.as_string(), node, path)) return;
    if (std::ranges::find(parameter.choices, node.text()) != parameter.choices.end()) return;
    complain(node, path, "'" + node.text() + "' is not one of " + joined(parameter.choices),
             did_you_mean(node.text(), parameter.choices));
  }

  void check_list(const Node& node, const Parameter& parameter, const std::string& path) {
    if (!node.is_list()) {
      complain(node, path, "expected a list, found " + node.kind());
      return;
    }
    if (parameter.size && node.items().size() != *parameter.size) {
      complain(node, path,
               "expected a list of " + std::to_string(*parameter.size) + ", found " +
                   std::to_string(node.items().size()));
    }
    Parameter item = parameter;
    item.type = parameter.type == ParameterType::kDoubles   ? ParameterType::kDouble
                : parameter.type == ParameterType::kInts    ? ParameterType::kInt
                : parameter.type == ParameterType::kStrings ? ParameterType::kString
                                                            : ParameterType::kObject;
    for (std::size_t i = 0; i < node.items().size(); ++i) {
      check_present(node.items()[i], item, path + "[" + std::to_string(i) + "]");
    }
  }

  std::vector<Error>& errors_;
};

}  // namespace

std::string_view to_string(PluginKind kind) noexcept {
  switch (kind) {
    case PluginKind::kSource: return "source";
    case PluginKind::kMapper: return "mapper";
    case PluginKind::kField: return "field";
    case PluginKind::kRobot: return "robot";
    case PluginKind::kOptimiser: return "optimiser";
    case PluginKind::kExecutor: return "executor";
    case PluginKind::kCost: return "cost";
    case PluginKind::kExperiment: return "experiment";
    case PluginKind::kPredictor: return "predictor";
    case PluginKind::kGaze: return "gaze";
    case PluginKind::kLocaliser: return "localiser";
  }
  return "unknown";
}

std::string_view to_string(ParameterType type) noexcept {
  switch (type) {
    case ParameterType::kBool: return "boolean";
    case ParameterType::kInt: return "integer";
    case ParameterType::kDouble: return "number";
    case ParameterType::kString: return "string";
    case ParameterType::kPath: return "path";
    case ParameterType::kChoice: return "choice";
    case ParameterType::kDoubles: return "list of numbers";
    case ParameterType::kInts: return "list of integers";
    case ParameterType::kStrings: return "list of strings";
    case ParameterType::kObject: return "map";
    case ParameterType::kObjects: return "list of maps";
    case ParameterType::kNode: return "structure";
  }
  return "structure";
}

void check_against_schema(const Node& map, const Schema& schema,
                          const std::vector<std::string>& also_allowed,
                          std::vector<Error>& errors) {
  if (!map.is_map()) {
    errors.push_back(map.error("expected a map, found " + map.kind()));
    return;
  }
  Checker(errors).check_map(map, schema, "", also_allowed);
}

void report_mistakes(const Node& map, const std::vector<OptionMistake>& mistakes,
                     std::vector<Error>& errors) {
  for (const OptionMistake& mistake : mistakes) {
    const Node* node = nullptr;
    for (const std::string& parameter : mistake.parameters) {
      node = find_path(map, parameter);
      if (node != nullptr) break;
    }
    const std::string name =
        mistake.parameters.empty() ? "" : "'" + mistake.parameters.front() + "' ";
    errors.push_back((node != nullptr ? *node : map).error(name + mistake.what, mistake.hint));
  }
}

namespace detail {

std::string number_text(double value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof(buffer), value);
  return error == std::errc{} ? std::string(buffer, end) : "nan";
}

}  // namespace detail
}  // namespace sidestep
