#include <sidestep/runtime/yaml_document.hpp>

#include <algorithm>
#include <sstream>
#include <unordered_map>

#include <yaml-cpp/depthguard.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <sidestep/core/file.hpp>

namespace sidestep {
namespace {

constexpr std::uintmax_t kMostDocumentBytes = std::uintmax_t{8} << 20;

constexpr int kMaxDepth = 100;

tl::unexpected<Error> too_deep(const SourceMark& mark) {
  return fail(ErrorCode::kConfig,
              "nested too deeply; " + std::to_string(kMaxDepth) + " deep at most is read",
              mark.to_string());
}

/// Turns a YAML tree into Nodes. What leaves the rest readable is appended to `errors`.
class Converter {
 public:
  Converter(std::string file, std::vector<Error>& errors)
      : file_(std::move(file)), errors_(errors) {}

  Result<Node> convert(const YAML::Node& yaml) {
    const SourceMark mark = mark_of(yaml.Mark());
    // Aliases count each time they are used: few lines of them can stand for billions of values.
    if (++nodes_ > kMaxNodes) {
      return fail(ErrorCode::kConfig,
                  "the document is too large once its aliases are filled in; " +
                      std::to_string(kMaxNodes) + " values at most are read",
                  mark.to_string());
    }
    if (++depth_ > kMaxDepth) return too_deep(mark);
    Result<Node> node = convert_any(yaml, mark);
    --depth_;
    return node;
  }

 private:
  static constexpr int kMaxNodes = 1'000'000;

  Result<Node> convert_any(const YAML::Node& yaml, const SourceMark& mark) {
    // "?" is yaml-cpp's tag of a plain node, "!" that of a quoted scalar.
    const std::string& tag = yaml.Tag();
    if (!tag.empty() && tag != "?" && tag != "!") {
      return fail(ErrorCode::kConfig, "the tag '" + tag + "' is not supported", mark.to_string());
    }
    switch (yaml.Type()) {
      case YAML::NodeType::Undefined:
      case YAML::NodeType::Null: {
        Node null;
        null.set_mark(mark);
        return null;
      }
      case YAML::NodeType::Scalar: return Node(Node::Scalar{yaml.Scalar(), tag == "!"}, mark);
      case YAML::NodeType::Sequence: return convert_list(yaml, mark);
      case YAML::NodeType::Map: return convert_map(yaml, mark);
    }
    return fail(ErrorCode::kInternal, "unknown kind of YAML node", mark.to_string());
  }

  Result<Node> convert_list(const YAML::Node& yaml, const SourceMark& mark) {
    Node::List list;
    list.reserve(yaml.size());
    for (const YAML::Node& item : yaml) {
      auto node = SIDESTEP_TRY(convert(item));
      if (node.is_null()) node.set_mark(mark);  // yaml-cpp gives nulls no position
      list.push_back(std::move(node));
    }
    return Node(std::move(list), mark);
  }

  Result<Node> convert_map(const YAML::Node& yaml, const SourceMark& mark) {
    Node::Map map;
    std::unordered_map<std::string, std::string> seen;
    for (const auto& pair : yaml) {
      const SourceMark key_mark = mark_of(pair.first.Mark());
      if (!pair.first.IsScalar()) {
        return fail(ErrorCode::kConfig, "a key must be a plain string", key_mark.to_string());
      }
      const std::string& key = pair.first.Scalar();
      const auto [first, is_new] = seen.emplace(key, key_mark.to_string());
      if (!is_new) {
        errors_.push_back(Error{ErrorCode::kConfig, "the key '" + key + "' appears twice",
                                key_mark.to_string(), "first at " + first->second, nullptr});
        continue;
      }
      auto value = SIDESTEP_TRY(convert(pair.second));
      // yaml-cpp gives nulls no position; the key's will do.
      if (value.is_null()) value.set_mark(key_mark);
      map.push_back({key, key_mark, std::move(value)});
    }
    return Node(std::move(map), mark);
  }

  SourceMark mark_of(const YAML::Mark& mark) const {
    if (mark.is_null()) return {file_, 0, 0};
    return {file_, mark.line + 1, mark.column + 1};
  }

  std::string file_;
  std::vector<Error>& errors_;
  int depth_ = 0;
  int nodes_ = 0;
};

/// Hears of nothing but where documents begin.
class DocumentStart final : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark& at) override { mark = at; }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t,
                const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}

  YAML::Mark mark;
};

bool is_control(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }

bool needs_quotes(const std::string& text) {
  if (text.empty()) return true;
  if (text.find_first_of(":#{}[],&*!|>'\"%@`") != std::string::npos) return true;
  if (std::any_of(text.begin(), text.end(), is_control)) return true;
  if (text.front() == ' ' || text.back() == ' ' || text.front() == '-' || text.front() == '?') {
    return true;
  }
  return text == "true" || text == "false" || text == "null" || text == "Null" || text == "NULL" ||
         text == "~";
}

std::string quoted(const std::string& text) {
  constexpr const char* kHex = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : text) {
    if (c == '\n') {
      out += "\\n";
    } else if (is_control(c)) {
      out += {'\\', 'x', kHex[(c >> 4) & 0xf], kHex[c & 0xf]};
    } else {
      if (c == '"' || c == '\\') out += '\\';
      out += c;
    }
  }
  return out + '"';
}

std::string scalar_text(const Node& node) {
  if (node.is_null()) return "null";
  if (node.kind() != "a string") return node.text();
  const bool reads_as_string = Node(Node::Scalar{node.text(), false}, {}).kind() == "a string";
  return reads_as_string && !needs_quotes(node.text()) ? node.text() : quoted(node.text());
}

/// A comment that says where a value comes from; on one line, whatever the origin holds.
std::string origin_comment(const SourceMark& mark) {
  std::string text = mark.to_string();
  std::replace_if(text.begin(), text.end(), is_control, ' ');
  return "  # " + text;
}

/// Whether a list fits on one line: scalars, all from one place.
bool is_flat(const Node& list) {
  const auto from_elsewhere = [&](const Node& item) {
    return !item.is_scalar() || item.mark().file != list.mark().file;
  };
  return std::none_of(list.items().begin(), list.items().end(), from_elsewhere);
}

std::string flow_text(const Node& list) {
  std::string text = "[";
  for (const Node& item : list.items()) {
    if (text.size() > 1) text += ", ";
    text += scalar_text(item);
  }
  return text + "]";
}

class Writer {
 public:
  explicit Writer(bool origins) : origins_(origins) {}

  void write(const Node& node, int indent) {
    if (node.is_map()) {
      for (const Node::Entry& entry : node.entries()) {
        pad(indent);
        out_ << scalar_text(Node(Node::Scalar{entry.key, false}, {})) << ':';
        write_value(entry.value, indent);
      }
    } else {
      for (const Node& item : node.items()) {
        pad(indent);
        out_ << '-';
        write_value(item, indent);
      }
    }
  }

  std::string text() const { return out_.str(); }

 private:
  void pad(int indent) { out_ << std::string(static_cast<std::size_t>(indent), ' '); }

  void write_value(const Node& value, int indent) {
    if (value.is_map() && value.entries().empty()) {
      out_ << " {}\n";
    } else if (value.is_map() || (value.is_list() && !is_flat(value))) {
      out_ << '\n';
      write(value, indent + 2);
    } else {
      out_ << ' ' << (value.is_list() ? flow_text(value) : scalar_text(value));
      if (origins_ && !value.mark().file.empty()) out_ << origin_comment(value.mark());
      out_ << '\n';
    }
  }

  std::ostringstream out_;
  bool origins_;
};

/// YAML has no control characters but those of white space. yaml-cpp drops some, and takes a byte
/// of 0 for the beginning of an escape.
Result<void> check_characters(std::string_view text, const std::string& name) {
  int line = 1, column = 1;
  for (const char c : text) {
    if (is_control(c) && c != '\t' && c != '\r' && c != '\n') {
      return fail(ErrorCode::kConfig,
                  "the byte " + std::to_string(static_cast<unsigned char>(c)) +
                      " is no character of a text in UTF-8",
                  SourceMark{name, line, column}.to_string());
    }
    column = c == '\n' ? 1 : column + 1;
    line += c == '\n' ? 1 : 0;
  }
  return {};
}

}  // namespace

Result<Node> YamlDocumentReader::read_leniently(const std::filesystem::path& file,
                                                std::vector<Error>& errors) const {
  const std::string text = SIDESTEP_TRY(read_file(file, kMostDocumentBytes));
  return parse_yaml(text, file.string(), errors);
}

Result<Node> parse_yaml(std::string_view text, const std::string& name,
                        std::vector<Error>& errors) {
  SIDESTEP_TRY(check_characters(text, name));
  try {
    // Not YAML::LoadAll(), which finds documents without end in `[1], 2`.
    std::istringstream stream{std::string(text)};
    YAML::Parser parser(stream);
    DocumentStart start;
    if (!parser.HandleNextDocument(start)) {
      Node empty;
      empty.set_mark({name, 1, 1});
      return empty;
    }
    if (parser.HandleNextDocument(start)) {
      return fail(ErrorCode::kConfig, "more than one document in a file",
                  SourceMark{name, start.mark.line + 1, start.mark.column + 1}.to_string());
    }
    return Converter(name, errors).convert(YAML::Load(std::string(text)));
  } catch (const YAML::Exception& exception) {
    const SourceMark mark{name, exception.mark.line + 1, exception.mark.column + 1};
    // yaml-cpp has a limit of its own, 500, and calls what is beyond it a bad file.
    if (dynamic_cast<const YAML::DeepRecursion*>(&exception) != nullptr) return too_deep(mark);
    return fail(ErrorCode::kConfig, "not valid YAML: " + exception.msg, mark.to_string());
  }
}

std::string to_yaml(const Node& node, bool origins) {
  if (node.is_scalar() || node.is_null()) return scalar_text(node) + "\n";
  Writer writer(origins);
  writer.write(node, 0);
  return writer.text();
}

}  // namespace sidestep
