#include "document_entry.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <utility>

#include <sidestep/core/file.hpp>

namespace sidestep {
namespace {

/// `:line:column` of a byte, both from 1.
std::string position_text(const std::string& text, std::size_t byte) {
  const std::size_t end = std::min(byte > 0 ? byte - 1 : 0, text.size());
  const auto before = text.begin() + static_cast<std::ptrdiff_t>(end);
  const auto line = 1 + std::count(text.begin(), before, '\n');
  const std::size_t newline = end > 0 ? text.rfind('\n', end - 1) : std::string::npos;
  const std::size_t column = newline == std::string::npos ? end + 1 : end - newline;
  return ":" + std::to_string(line) + ":" + std::to_string(column);
}

/// Finds keys that an object has twice, of which a parser keeps the last.
class KeyWatch {
 public:
  bool operator()(int, nlohmann::json::parse_event_t event, const nlohmann::json& value) {
    using Event = nlohmann::json::parse_event_t;
    if (event == Event::object_start) keys_.emplace_back();
    if (event == Event::object_end) keys_.pop_back();
    if (event != Event::key) return true;
    const auto& key = value.get_ref<const std::string&>();
    if (!keys_.back().insert(key).second && !twice_) twice_ = key;
    return true;
  }
  [[nodiscard]] const std::optional<std::string>& twice() const { return twice_; }

 private:
  std::vector<std::set<std::string>> keys_;  ///< Of the objects that are open.
  std::optional<std::string> twice_;
};

}  // namespace

void DocumentEntry::complain(const std::string& message, const std::string& hint) const {
  if (*error_ || node_ == nullptr) return;
  *error_ = node_->error(path_.empty() ? message : "`" + path_ + "`: " + message, hint);
}

bool DocumentEntry::expect(bool is, const std::string& what) const {
  if (node_ == nullptr) return false;  // told of already
  if (!is) complain("expected " + what + ", found " + node_->kind());
  return is;
}

bool DocumentEntry::has(const char* key) const {
  const Node* found = is_map() ? node_->find(key) : nullptr;
  if (found == nullptr || found->is_null()) return false;
  return !found->is_list() || !found->items().empty();
}

void DocumentEntry::expect_keys(const std::vector<std::string>& known) const {
  if (*error_ || !is_map()) return;
  for (const Node::Entry& entry : node_->entries()) {
    if (std::ranges::find(known, entry.key) != known.end()) continue;
    const std::string in = path_.empty() ? "" : " in `" + path_ + "`";
    *error_ = Error{ErrorCode::kConfig, "unknown key '" + entry.key + "'" + in,
                    entry.key_mark.to_string(),
                    did_you_mean(entry.key, known, "known here: " + joined(known)), nullptr};
    return;
  }
}

DocumentEntry DocumentEntry::operator[](const char* key) const {
  std::string path = path_.empty() ? key : path_ + "." + key;
  const Node* found = nullptr;
  if (expect(node_ != nullptr && node_->is_map(), "a map")) {
    found = node_->find(key);
    if (found == nullptr) complain(std::string("there is no `") + key + "`");
  }
  return {found, error_, std::move(path)};
}

std::vector<DocumentEntry> DocumentEntry::items() const {
  std::vector<DocumentEntry> all;
  if (!expect(node_ != nullptr && node_->is_list(), "a list")) return all;
  for (const Node& item : node_->items()) {
    all.push_back({&item, error_, path_ + "[" + std::to_string(all.size()) + "]"});
  }
  return all;
}

double DocumentEntry::number() const {
  if (node_ == nullptr) return 0.0;
  const auto value = node_->as_double();
  keep_error(value);
  return value.value_or(0.0);
}

std::string DocumentEntry::text() const {
  if (node_ == nullptr) return "";
  const auto value = node_->as_string();
  keep_error(value);
  return value.value_or("");
}

Eigen::VectorXd DocumentEntry::numbers(std::size_t count) const {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(count));
  if (node_ == nullptr) return values;
  const auto listed = node_->as_doubles(count);
  keep_error(listed);
  if (listed) values = Eigen::Map<const Eigen::VectorXd>(listed->data(), values.size());
  return values;
}

Result<JsonEntry::File> JsonEntry::read(const std::string& file_name) {
  const auto text = SIDESTEP_TRY(read_file(file_name));
  try {
    KeyWatch keys;
    auto content = nlohmann::json::parse(text, std::ref(keys));
    if (keys.twice()) {
      return fail(ErrorCode::kConfig, "an object has the key '" + *keys.twice() + "' twice",
                  file_name);
    }
    return File{file_name, std::move(content), std::nullopt};
  } catch (const nlohmann::json::parse_error& error) {
    return fail(ErrorCode::kConfig, "this is no valid JSON",
                file_name + position_text(text, error.byte));
  } catch (const nlohmann::json::out_of_range& error) {
    return fail(ErrorCode::kConfig, std::string("a number is too large: ") + error.what(),
                file_name);
  }
}

std::string JsonEntry::kind() const {
  if (value_->is_object()) return "an object";
  if (value_->is_array()) return "an array of " + std::to_string(value_->size());
  return value_->dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

void JsonEntry::complain(const std::string& message) const {
  if (file_->error) return;
  const std::string where = path_.empty() ? file_->name : file_->name + ": " + path_;
  file_->error = Error{ErrorCode::kConfig, message, where, {}, nullptr};
}

bool JsonEntry::expect(bool is, const char* what) const {
  if (value_ == nullptr) return false;  // told of already
  if (!is) complain(std::string("expected ") + what + ", found " + kind());
  return is;
}

bool JsonEntry::has(const char* key) const {
  return value_ != nullptr && value_->is_object() && value_->contains(key);
}

void JsonEntry::expect_keys(const std::vector<std::string>& known) const {
  if (value_ == nullptr || !value_->is_object()) return;
  for (const auto& [key, value] : value_->items()) {
    if (std::ranges::find(known, key) != known.end()) continue;
    const std::string hint = did_you_mean(key, known);
    complain("unknown key `" + key + "`" + (hint.empty() ? "" : ": " + hint));
    return;
  }
}

JsonEntry JsonEntry::operator[](const char* key) const {
  std::string path = path_.empty() ? key : path_ + "." + key;
  const nlohmann::json* found = nullptr;
  if (expect(value_ != nullptr && value_->is_object(), "an object")) {
    const auto at = value_->find(key);
    if (at != value_->end()) {
      found = &*at;
    } else {
      complain(std::string("there is no `") + key + "`");
    }
  }
  return {*file_, found, std::move(path)};
}

JsonEntry JsonEntry::at(std::size_t index) const {
  std::string path = path_ + "[" + std::to_string(index) + "]";
  const nlohmann::json* found = nullptr;
  if (expect(value_ != nullptr && value_->is_array(), "an array")) {
    if (index < value_->size()) {
      found = &(*value_)[index];
    } else {
      complain("there are " + std::to_string(value_->size()) + " values, and no number " +
               std::to_string(index + 1));
    }
  }
  return {*file_, found, std::move(path)};
}

std::size_t JsonEntry::size() const {
  return expect(value_ != nullptr && value_->is_array(), "an array") ? value_->size() : 0;
}

std::vector<JsonEntry> JsonEntry::items() const {
  std::vector<JsonEntry> all;
  const std::size_t count = size();
  for (std::size_t i = 0; i < count; ++i) all.push_back(at(i));
  return all;
}

double JsonEntry::number() const {
  if (!expect(value_ != nullptr && value_->is_number(), "a number")) return 0.0;
  return value_->get<double>();
}

double JsonEntry::positive() const {
  const double value = number();
  (void)expect(value > 0.0, "a number above 0");
  return value;
}

int JsonEntry::integer(int least, int most) const {
  const double value = number();
  if (value_ == nullptr || !value_->is_number()) return least;
  if (value == std::floor(value) && value >= least && value <= most) {
    return static_cast<int>(value);
  }
  const std::string range = std::to_string(least) + " to " + std::to_string(most);
  (void)expect(false, ("a whole number from " + range).c_str());
  return least;
}

bool JsonEntry::flag() const {
  if (value_ != nullptr && value_->is_boolean()) return value_->get<bool>();
  return integer(0, 1) == 1;
}

std::string JsonEntry::text() const {
  if (!expect(value_ != nullptr && value_->is_string(), "a string")) return "";
  return value_->get<std::string>();
}

Eigen::VectorXd JsonEntry::numbers(std::size_t count) const {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(count));
  if (!expect(value_ != nullptr && value_->is_array() && value_->size() == count,
              ("an array of " + std::to_string(count) + " numbers").c_str())) {
    return values;
  }
  for (std::size_t i = 0; i < count; ++i) values[static_cast<Eigen::Index>(i)] = at(i).number();
  return values;
}

}  // namespace sidestep
