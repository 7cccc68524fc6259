#include "document_entry.hpp"

namespace sidestep {

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

}  // namespace sidestep
