#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>

namespace sidestep {

/// What readers of documents share: every mistake goes to a list, and reading goes on.
class NodeReader {
 public:
  using Names = std::vector<std::string>;

  explicit NodeReader(std::vector<Error>& errors) : errors_(errors) {}

 protected:
  [[nodiscard]] std::vector<Error>& errors() noexcept { return errors_; }
  void add(Error error) { errors_.push_back(std::move(error)); }

  template <class T>
  std::optional<T> keep(Result<T> result) {
    if (result) return std::move(*result);
    add(std::move(result.error()));
    return {};
  }

  void check_keys(const Node& map, const Names& known) {
    for (const Node::Entry& entry : map.entries()) {
      if (std::ranges::find(known, entry.key) != known.end()) continue;
      add(Error{ErrorCode::kConfig, "unknown key '" + entry.key + "'", entry.key_mark.to_string(),
                did_you_mean(entry.key, known, "known here: " + joined(known)), nullptr});
    }
  }

  const Node* require(const Node& map, const std::string& key, const std::string& owner) {
    const Node* value = map.find(key);
    if (value == nullptr || value->is_null()) {
      add(map.error(owner + " needs the key '" + key + "'"));
      return nullptr;
    }
    return value;
  }

  double positive(const Node& node, const std::string& what) {
    const auto value = keep(node.as_double());
    if (value && *value > 0.0) return *value;
    if (value) add(node.error(what + " must be greater than 0, found " + node.text()));
    return 1.0;
  }

  /// Two numbers, the first not above the second.
  std::optional<std::pair<double, double>> range(const Node& node, const std::string& what) {
    const auto values = keep(node.as_doubles(2));
    if (!values) return {};
    if ((*values)[0] > (*values)[1]) {
      add(node.error("the range " + what + " is upside down"));
      return {};
    }
    return std::pair((*values)[0], (*values)[1]);
  }

 private:
  std::vector<Error>& errors_;
};

}  // namespace sidestep
