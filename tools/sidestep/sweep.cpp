#include "sweep.hpp"

#include <algorithm>
#include <cctype>
#include <regex>

#include <nlohmann/json.hpp>

namespace sidestep {
namespace {

constexpr std::size_t kMostRuns = 100'000;
constexpr std::size_t kLongestName = 120;

using Values = std::vector<std::pair<std::string, std::string>>;

/// Text that is read as itself: as it is, or as JSON's strings, which are YAML's.
std::string as_text(const std::string& text) {
  static const std::regex kWord("[A-Za-z_/][A-Za-z0-9_./-]*"), kNoString("true|false|null");
  const bool is_word = std::regex_match(text, kWord) && !std::regex_match(text, kNoString);
  return is_word ? text : nlohmann::json(text).dump();
}

/// A value in one line of YAML.
std::string in_one_line(const Node& value) {
  if (value.is_null()) return "null";
  if (value.is_list()) {
    std::vector<std::string> items;
    for (const Node& item : value.items()) items.push_back(in_one_line(item));
    return "[" + joined(items) + "]";
  }
  if (value.is_map()) {
    std::vector<std::string> entries;
    for (const Node::Entry& entry : value.entries()) {
      entries.push_back(as_text(entry.key) + ": " + in_one_line(entry.value));
    }
    return "{" + joined(entries) + "}";
  }
  return value.kind() == "a string" ? as_text(value.text()) : value.text();
}

/// Whether two keys are of the same value, or one is of a part of the other's.
bool overlap(const std::string& a, const std::string& b) {
  return (a + ".").starts_with(b + ".") || (b + ".").starts_with(a + ".");
}

/// The name of a run's folder: its number, and what makes it.
std::string folder_of(std::size_t index, std::size_t count, const Values& values) {
  std::string number = std::to_string(index + 1);
  number.insert(0, std::to_string(count).size() - number.size(), '0');
  std::string name = number;
  for (const auto& [key, value] : values) name.append("-").append(key).append("=").append(value);
  for (char& c : name) {
    const bool is_safe = std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                         std::string_view("._=,-+").find(c) != std::string_view::npos;
    if (!is_safe) c = '_';
  }
  return name.substr(0, kLongestName);
}

/// What each axis of the grid may be.
using Axis = std::pair<std::string, std::vector<std::string>>;

class Reader {
 public:
  Reader(Sweep& sweep, std::vector<Error>& errors) : sweep_(sweep), errors_(errors) {}

  void read(const Node& root) {
    static const std::vector<std::string> kKeys = {"schema_version", "configuration", "grid",
                                                   "runs"};
    for (const Node::Entry& entry : root.entries()) {
      if (std::ranges::find(kKeys, entry.key) != kKeys.end()) continue;
      errors_.push_back({ErrorCode::kConfig, "unknown key '" + entry.key + "'",
                         entry.key_mark.to_string(),
                         did_you_mean(entry.key, kKeys, "a sweep has " + joined(kKeys)), nullptr});
    }
    const Node* const version = root.find("schema_version");
    if (version == nullptr || version->text() != "1") {
      errors_.push_back(
          (version != nullptr ? *version : root).error("a sweep has schema_version: 1"));
    }
    read_configuration(root);
    read_grid(root);
    read_runs(root);
    if (errors_.empty()) combine(root);
  }

 private:
  void read_configuration(const Node& root) {
    const Node* const name = root.find("configuration");
    if (name == nullptr || !name->is_scalar() || name->text().empty()) {
      errors_.push_back(root.error("'configuration' is missing",
                                   "the file that is run, or the name of an installed one"));
      return;
    }
    std::error_code ignored;
    const auto path = name->as_path();
    const bool is_file = path && std::filesystem::is_regular_file(*path, ignored);
    sweep_.configuration = is_file ? path->string() : name->text();
  }

  void read_grid(const Node& root) {
    const Node* const grid = root.find("grid");
    if (grid == nullptr || grid->is_null()) return;
    if (!grid->is_map()) return errors_.push_back(grid->error("'grid' must be a map of lists"));
    for (const Node::Entry& entry : grid->entries()) {
      if (!entry.value.is_list() || entry.value.items().empty()) {
        errors_.push_back(entry.value.error("'" + entry.key + "' must be a list of values",
                                            entry.key + ": [1, 2]"));
        continue;
      }
      for (const Axis& other : axes_) {
        if (!overlap(other.first, entry.key)) continue;
        errors_.push_back(entry.value.error("'" + entry.key + "' is a part of '" + other.first +
                                            "', or the other way round"));
      }
      Axis& axis = axes_.emplace_back(entry.key, std::vector<std::string>{});
      for (const Node& value : entry.value.items()) {
        axis.second.push_back(in_one_line(value));
        if (std::ranges::count(axis.second, axis.second.back()) == 1) continue;
        errors_.push_back(
            value.error("'" + entry.key + "' has the value " + axis.second.back() + " twice"));
      }
    }
  }

  void read_runs(const Node& root) {
    const Node* const runs = root.find("runs");
    if (runs == nullptr || runs->is_null()) return;
    if (!runs->is_list() || runs->items().empty()) {
      return errors_.push_back(runs->error("'runs' must be a list of maps"));
    }
    for (const Node& run : runs->items()) {
      if (!run.is_map()) {
        errors_.push_back(
            run.error("a run must be a map of values", "- {optimiser.plugin: chomp}"));
        continue;
      }
      Values& values = lists_.emplace_back();
      for (const Node::Entry& entry : run.entries()) {
        for (const Axis& axis : axes_) {
          if (!overlap(axis.first, entry.key)) continue;
          errors_.push_back(entry.value.error("'" + entry.key + "' is in the grid, too, as '" +
                                              axis.first + "'"));
        }
        values.emplace_back(entry.key, in_one_line(entry.value));
      }
      if (std::ranges::count(lists_, values) > 1) {
        errors_.push_back(run.error("the same run is there before"));
      }
    }
  }

  void add_key(const std::string& key) {
    if (std::ranges::find(sweep_.keys, key) == sweep_.keys.end()) sweep_.keys.push_back(key);
  }

  /// Each of `runs` with every combination of the grid, its last axis first.
  void combine(const Node& root) {
    if (lists_.empty()) lists_.emplace_back();
    std::size_t count = lists_.size();
    for (const Axis& axis : axes_) count = std::min(count * axis.second.size(), 2 * kMostRuns);
    if (axes_.empty() && std::ranges::all_of(lists_, &Values::empty)) {
      return errors_.push_back(root.error("there is nothing to vary: give a grid or runs"));
    }
    if (count > kMostRuns) {
      return errors_.push_back(
          root.error("that is more than " + std::to_string(kMostRuns) + " runs"));
    }
    for (std::size_t i = 0; i < count; ++i) {
      std::size_t rest = i;
      Values of_grid;
      for (auto axis = axes_.rbegin(); axis != axes_.rend(); ++axis) {
        of_grid.emplace_back(axis->first, axis->second[rest % axis->second.size()]);
        rest /= axis->second.size();
      }
      Values values = lists_[rest];
      values.insert(values.end(), of_grid.rbegin(), of_grid.rend());
      for (const auto& [key, value] : values) add_key(key);
      std::string folder = folder_of(i, count, values);
      sweep_.runs.push_back({std::move(folder), std::move(values)});
    }
  }

  Sweep& sweep_;
  std::vector<Error>& errors_;
  std::vector<Axis> axes_;
  std::vector<Values> lists_;
};

}  // namespace

std::vector<std::string> SweepRun::overrides() const {
  std::vector<std::string> overrides;
  for (const auto& [key, value] : values) {
    overrides.emplace_back(key).append("=").append(value);
  }
  return overrides;
}

std::vector<Error> read_sweep(const std::filesystem::path& file, const DocumentReader& documents,
                              Sweep& sweep) {
  std::vector<Error> errors;
  const auto root = documents.read_leniently(file, errors);
  if (!root) {
    errors.push_back(root.error());
  } else if (!root->is_map()) {
    errors.push_back(root->error("a sweep is a map"));
  } else {
    Reader(sweep, errors).read(*root);
  }
  return errors;
}

}  // namespace sidestep
