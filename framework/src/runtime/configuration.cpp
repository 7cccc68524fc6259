#include <sidestep/runtime/configuration.hpp>

#include <algorithm>
#include <charconv>
#include <string_view>
#include <unordered_map>

#include <sidestep/runtime/yaml_document.hpp>

namespace sidestep {
namespace {

constexpr int kSchemaVersion = 1;
constexpr int kMostFiles = 200;  ///< Of a configuration, each as often as it is a base.
const std::string kOverridePrefix = "--set ";

const std::vector<std::string> kTopLevelKeys = {
    "schema_version", "base",   "without",   "plugin_paths", "experiment",
    "robot",          "source", "mapper",    "field",        "optimiser",
    "planning",       "check",  "executor",  "replanner",    "sampler",
    "predictor",      "gaze",   "localiser", "sources"};

/// `over` laid on `under`, key by key. A map that names another plugin replaces the whole map.
Node merged(Node under, const Node& over) {
  if (!under.is_map() || !over.is_map()) return over;
  const Node* old_plugin = under.find("plugin");
  const Node* new_plugin = over.find("plugin");
  if (old_plugin != nullptr && new_plugin != nullptr && old_plugin->text() != new_plugin->text()) {
    return over;
  }
  Node::Map& entries = under.entries();
  entries.reserve(entries.size() + over.entries().size());  // the keys that are viewed stay
  std::unordered_map<std::string_view, Node*> known;
  for (Node::Entry& entry : entries) known.emplace(entry.key, &entry.value);
  for (const Node::Entry& entry : over.entries()) {
    if (const auto found = known.find(entry.key); found != known.end()) {
      *found->second = merged(std::move(*found->second), entry.value);
    } else {
      entries.push_back(entry);
    }
  }
  under.set_mark(over.mark());
  return under;
}

class Reader {
 public:
  Reader(const DocumentReader& documents, std::vector<Error>& errors)
      : documents_(documents), errors_(errors) {}

  /// Leaves out the bases of these names, wherever they are named.
  void leave_out(const Node& names) {
    if (names.is_null()) return;
    for (const Node& name : names.is_list() ? names.items() : std::vector<Node>{names}) {
      left_out_.push_back({name.text(), name.mark(), false});
    }
  }
  /// Appends a mistake for each name that no base had.
  void check_left_out() {
    for (const LeftOut& left_out : left_out_) {
      if (left_out.was_met) continue;
      errors_.push_back(
          Error{ErrorCode::kConfig, "'without': no base is called '" + left_out.name + "'",
                left_out.mark.to_string(), did_you_mean(left_out.name, bases_), nullptr});
    }
  }

  /// The document of a file, merged with its bases; an empty map where it cannot be read.
  Node read(const std::filesystem::path& file, const SourceMark& named_at) {
    Node empty(Node::Map{}, {file.string(), 1, 1});
    if (++files_ > kMostFiles) {
      if (files_ == kMostFiles + 1) {
        errors_.push_back(Error{ErrorCode::kConfig,
                                "more than " + std::to_string(kMostFiles) +
                                    " files are named as bases, and bases of bases",
                                named_at.to_string(),
                                {},
                                nullptr});
      }
      return empty;
    }
    std::error_code unknown;  // e.g. a name too long; reading the file says so
    const std::filesystem::path identity = std::filesystem::weakly_canonical(file, unknown);
    if (std::ranges::find(open_, identity) != open_.end()) {
      errors_.push_back(Error{ErrorCode::kConfig,
                              "'" + file.string() + "' is its own base",
                              named_at.to_string(),
                              {},
                              nullptr});
      return empty;
    }
    Result<Node> document = documents_.read_leniently(file, errors_);
    if (!document) {
      Error error = std::move(document.error());
      if (named_at.line > 0) {
        error = error.wrapped(ErrorCode::kConfig, "the base cannot be read", named_at.to_string());
      }
      errors_.push_back(std::move(error));
      return empty;
    }
    if (!document->is_map()) {
      errors_.push_back(document->error("expected a map, found " + document->kind()));
      return empty;
    }
    open_.push_back(identity);
    Node result = with_bases(*document);
    open_.pop_back();
    return result;
  }

 private:
  struct LeftOut {
    std::string name;
    SourceMark mark;
    bool was_met;
  };
  [[nodiscard]] bool is_left_out(const std::string& name) {
    bases_.push_back(name);
    const auto found = std::ranges::find(left_out_, name, &LeftOut::name);
    if (found == left_out_.end()) return false;
    return found->was_met = true;
  }

  Node with_bases(Node& document) {
    if (const Node* without = document.find("without")) leave_out(*without);
    std::erase_if(document.entries(), [](const Node::Entry& e) { return e.key == "without"; });
    const Node* base = document.find("base");
    if (base == nullptr) return document;
    std::vector<Node> bases = base->is_list() ? base->items() : std::vector<Node>{*base};
    Node under(Node::Map{}, document.mark());
    for (const Node& one : bases) {
      const auto path = one.as_path();
      if (!path) {
        errors_.push_back(path.error());
      } else if (!is_left_out(path->stem().string())) {
        under = merged(std::move(under), read(*path, one.mark()));
      }
    }
    std::erase_if(document.entries(), [](const Node::Entry& e) { return e.key == "base"; });
    return merged(std::move(under), document);
  }

  const DocumentReader& documents_;
  std::vector<Error>& errors_;
  std::vector<std::filesystem::path> open_;
  int files_ = 0;
  std::vector<LeftOut> left_out_;
  std::vector<std::string> bases_;  ///< Names that were met.
};

/// Gives every node of an override the same origin.
void set_origin(Node& node, const SourceMark& origin) {
  node.set_mark(origin);
  if (node.is_list()) {
    for (Node& item : node.items()) set_origin(item, origin);
  } else if (node.is_map()) {
    for (Node::Entry& entry : node.entries()) {
      entry.key_mark = origin;
      set_origin(entry.value, origin);
    }
  }
}

/// Where an override's path leads, made on the way; null where a list has no such item or a
/// scalar is in the way.
Node* descend(Node& root, std::string_view path, const SourceMark& origin) {
  Node* node = &root;
  while (!path.empty()) {
    const std::size_t dot = path.find('.');
    const std::string_view key = path.substr(0, dot);
    path = dot == std::string_view::npos ? std::string_view{} : path.substr(dot + 1);
    if (node->is_list()) {
      std::size_t index = 0;
      const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), index);
      if (error != std::errc{} || end != key.data() + key.size() || index >= node->items().size()) {
        return nullptr;
      }
      node = &node->items()[index];
      continue;
    }
    if (node->is_null()) *node = Node(Node::Map{}, origin);
    if (!node->is_map()) return nullptr;
    Node* next = node->find(key);
    if (next == nullptr) {
      node->entries().push_back({std::string(key), origin, Node{}});
      next = &node->entries().back().value;
      next->set_mark(origin);
    }
    node = next;
  }
  return node;
}

/// What earlier overrides have written into a map: it stays, whichever order they come in.
Node only_overrides(const Node& map) {
  Node kept(Node::Map{}, map.mark());
  for (const Node::Entry& entry : map.entries()) {
    const SourceMark& mark = entry.value.mark();
    if (mark.line == 0 && mark.file.starts_with(kOverridePrefix)) {
      kept.entries().push_back(entry);
    } else if (Node below = only_overrides(entry.value); !below.entries().empty()) {
      kept.entries().push_back({entry.key, entry.key_mark, std::move(below)});
    }
  }
  return kept;
}

void apply_override(Node& root, const std::string& override_text, std::vector<Error>& errors) {
  const SourceMark origin{kOverridePrefix + override_text, 0, 0};
  const std::size_t equals = override_text.find('=');
  const std::string path = override_text.substr(0, equals);
  const std::string first_key = path.substr(0, path.find('.'));
  const bool malformed = equals == std::string::npos || path.empty() || path.front() == '.' ||
                         path.back() == '.' || path.find("..") != std::string::npos;
  if (malformed) {
    errors.push_back(
        Error{ErrorCode::kConfig, "expected key.key=value", origin.to_string(), {}, nullptr});
    return;
  }
  Result<Node> value = parse_yaml(override_text.substr(equals + 1), origin.file, errors);
  if (!value) {
    errors.push_back(
        Error{ErrorCode::kConfig, value.error().message, origin.to_string(), {}, nullptr});
    return;
  }
  set_origin(*value, origin);
  if (path.starts_with("without.")) {
    errors.push_back(Error{ErrorCode::kConfig, "'without' is set as a whole", origin.to_string(),
                           "--set 'without=[name, name]'", nullptr});
    return;
  }
  if (first_key == "base") {
    errors.push_back(Error{ErrorCode::kConfig, "'base' cannot be set on the command line",
                           origin.to_string(), "name it in a file", nullptr});
    return;
  }
  // A change of plugin drops the parameters of the plugin before, as it does between files.
  if (path == first_key + ".plugin") {
    Node* block = root.find(first_key);
    const Node* plugin = block != nullptr ? block->find("plugin") : nullptr;
    if (plugin != nullptr && plugin->text() != value->text()) *block = only_overrides(*block);
  }
  Node* target = descend(root, path, origin);
  if (target == nullptr) {
    errors.push_back(Error{
        ErrorCode::kConfig, "there is no '" + path + "' to set", origin.to_string(), {}, nullptr});
    return;
  }
  *target = std::move(*value);
}

/// Whether it says which bases are left out, before any is read.
bool is_without(const std::string& override_text) { return override_text.starts_with("without="); }

void check_plugin_paths(const Node& paths, std::vector<Error>& errors) {
  if (!paths.is_list()) {
    errors.push_back(
        paths.error("'plugin_paths': expected a list of paths, found " + paths.kind()));
  }
  for (std::size_t i = 0; i < paths.items().size(); ++i) {
    const Node& item = paths.items()[i];
    if (const auto path = item.as_path(); !path) {
      errors.push_back(
          item.error("'plugin_paths[" + std::to_string(i) + "]': " + path.error().message));
    }
  }
}

void check_top_level(const Node& root, const std::filesystem::path& file,
                     std::vector<Error>& errors) {
  for (const Node::Entry& entry : root.entries()) {
    if (std::ranges::find(kTopLevelKeys, entry.key) != kTopLevelKeys.end()) continue;
    errors.push_back(Error{ErrorCode::kConfig, "unknown key '" + entry.key + "'",
                           entry.key_mark.to_string(), did_you_mean(entry.key, kTopLevelKeys),
                           nullptr});
  }
  if (const Node* paths = root.find("plugin_paths")) check_plugin_paths(*paths, errors);
  const Node* version = root.find("schema_version");
  const std::string supported =
      "this version reads schema_version: " + std::to_string(kSchemaVersion);
  if (version == nullptr) {
    errors.push_back(Error{ErrorCode::kConfig, "'schema_version' is missing",
                           SourceMark{file.string(), 1, 1}.to_string(), supported, nullptr});
  } else if (const auto number = version->as_int(); !number) {
    errors.push_back(number.error());
  } else if (*number != kSchemaVersion) {
    errors.push_back(
        version->error("schema_version " + version->text() + " is not known", supported));
  }
}

}  // namespace

ConfigurationReading read_configuration(const std::filesystem::path& file,
                                        const std::vector<std::string>& overrides,
                                        const DocumentReader& documents) {
  ConfigurationReading reading;
  reading.configuration.name = file.stem().string();
  reading.configuration.file = file;
  Node said(Node::Map{}, {});
  for (const std::string& text : overrides) {
    if (is_without(text)) apply_override(said, text, reading.errors);
  }
  Reader reader(documents, reading.errors);
  if (const Node* without = said.find("without")) reader.leave_out(*without);
  Node root = reader.read(file, {});
  const bool unreadable = root.entries().empty() && !reading.errors.empty();
  if (!unreadable) reader.check_left_out();
  for (const std::string& text : overrides) {
    if (!is_without(text)) apply_override(root, text, reading.errors);
  }
  if (!unreadable) check_top_level(root, file, reading.errors);
  reading.configuration.root = std::move(root);
  return reading;
}

}  // namespace sidestep
