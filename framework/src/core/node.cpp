#include <sidestep/core/node.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numeric>

namespace sidestep {
namespace {

const Node::List kNoItems;
const Node::Map kNoEntries;
const std::string kNoText;

/// The whole of `text` as a number; nothing if anything else is in it.
template <class T>
std::optional<T> parse_number(std::string_view text) {
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || text.empty()) return {};
  return value;
}

/// YAML's spellings of infinities and NaN, which from_chars does not know.
bool is_special_number(std::string_view text) {
  if (text.starts_with('+') || text.starts_with('-')) text.remove_prefix(1);
  return text == ".inf" || text == ".Inf" || text == ".INF" || text == ".nan" || text == ".NaN" ||
         text == ".NAN";
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({row[j] + 1, row[j + 1] + 1, substituted});
    }
  }
  return row.back();
}

}  // namespace

std::string SourceMark::to_string() const {
  if (line <= 0) return file;
  return file + ":" + std::to_string(line) + ":" + std::to_string(column);
}

Node::Node(Scalar scalar, SourceMark mark) : value_(std::move(scalar)), mark_(std::move(mark)) {}

Node::Node(List list, SourceMark mark) : value_(std::move(list)), mark_(std::move(mark)) {}

Node::Node(Map map, SourceMark mark) : value_(std::move(map)), mark_(std::move(mark)) {}

std::string Node::kind() const {
  if (is_null()) return "nothing";
  if (is_list()) return "a list";
  if (is_map()) return "a map";
  if (!std::get<Scalar>(value_).quoted) {
    if (text() == "true" || text() == "false") return "a boolean";
    if (parse_number<double>(text()) || is_special_number(text())) return "a number";
  }
  return "a string";
}

const Node::List& Node::items() const noexcept {
  const auto* list = std::get_if<List>(&value_);
  return list != nullptr ? *list : kNoItems;
}

const Node::Map& Node::entries() const noexcept {
  const auto* map = std::get_if<Map>(&value_);
  return map != nullptr ? *map : kNoEntries;
}

Node::List& Node::items() { return std::get<List>(value_); }
Node::Map& Node::entries() { return std::get<Map>(value_); }

const Node* Node::find(std::string_view key) const noexcept {
  const Map& map = entries();
  const auto it = std::ranges::find(map, key, &Entry::key);
  return it == map.end() ? nullptr : &it->value;
}

Node* Node::find(std::string_view key) noexcept {
  return const_cast<Node*>(std::as_const(*this).find(key));
}

const std::string& Node::text() const noexcept {
  const auto* scalar = std::get_if<Scalar>(&value_);
  return scalar != nullptr ? scalar->text : kNoText;
}

Result<bool> Node::as_bool() const {
  if (kind() == "a boolean") return text() == "true";
  return tl::make_unexpected(
      error("expected true or false, found " + kind() + (is_scalar() ? " '" + text() + "'" : "")));
}

Result<std::int64_t> Node::as_int() const {
  if (is_scalar() && !std::get<Scalar>(value_).quoted) {
    if (const auto value = parse_number<std::int64_t>(text())) return *value;
  }
  return tl::make_unexpected(
      error("expected a whole number, found " + kind() + (is_scalar() ? " '" + text() + "'" : "")));
}

Result<double> Node::as_double() const {
  if (is_scalar() && !std::get<Scalar>(value_).quoted) {
    const auto value = parse_number<double>(text());
    if (value && std::isfinite(*value)) return *value;
    if (value || is_special_number(text())) {
      return tl::make_unexpected(error("expected a finite number, found '" + text() + "'"));
    }
  }
  return tl::make_unexpected(
      error("expected a number, found " + kind() + (is_scalar() ? " '" + text() + "'" : "")));
}

Result<std::string> Node::as_string() const {
  if (is_scalar()) return text();
  return tl::make_unexpected(error("expected a string, found " + kind()));
}

Result<std::vector<double>> Node::as_doubles(std::optional<std::size_t> size) const {
  const std::string expected =
      "expected a list of " + (size ? std::to_string(*size) + " " : std::string()) + "numbers";
  if (!is_list()) return tl::make_unexpected(error(expected + ", found " + kind()));
  if (size && items().size() != *size) {
    return tl::make_unexpected(error(expected + ", found " + std::to_string(items().size())));
  }
  std::vector<double> values;
  values.reserve(items().size());
  for (const Node& item : items()) {
    values.push_back(SIDESTEP_TRY(item.as_double()));
  }
  return values;
}

Result<std::filesystem::path> Node::as_path() const {
  if (!is_scalar()) return tl::make_unexpected(error("expected a path, found " + kind()));
  std::filesystem::path path = text();
  if (path.is_relative() && mark_.line > 0 && !path.empty()) {
    path = std::filesystem::path(mark_.file).parent_path() / path;
  }
  return path.lexically_normal();
}

Error Node::error(std::string message, std::string hint) const {
  return Error{ErrorCode::kConfig, std::move(message), mark_.to_string(), std::move(hint), nullptr};
}

Result<Node> DocumentReader::read(const std::filesystem::path& file) const {
  std::vector<Error> errors;
  Result<Node> node = read_leniently(file, errors);
  if (node && !errors.empty()) return tl::make_unexpected(std::move(errors.front()));
  return node;
}

std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, name.size() / 2) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = edit_distance(name, candidate);
    const bool has_something_in_common = distance < std::max(name.size(), candidate.size());
    if (distance < best_distance && has_something_in_common) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

std::string joined(const std::vector<std::string>& texts, std::string_view separator) {
  std::string all;
  for (const std::string& text : texts) {
    if (&text != &texts.front()) all += separator;
    all += text;
  }
  return all;
}

std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates,
                         std::string otherwise) {
  const std::string nearest = nearest_name(name, candidates);
  return nearest.empty() ? otherwise : "did you mean '" + nearest + "'?";
}

}  // namespace sidestep
