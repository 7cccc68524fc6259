#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <sidestep/core/error.hpp>

namespace sidestep {

/// Where a value was written: in a file (line and column from 1), on the command line, or
/// nowhere (a default).
struct SourceMark {
  std::string file;
  int line = 0;
  int column = 0;

  /// `file:line:col`, or `file` where there is no line (e.g. "--set field.signed=1").
  [[nodiscard]] std::string to_string() const;
};

/// One node of a structured document (a configuration, a scene, a robot profile): a scalar
/// as it was written, a list or a map, with its position. Plugins see documents only as
/// this; the file format is the host's affair. Maps keep the order in which they were written.
class Node {
 public:
  using List = std::vector<Node>;
  struct Entry;
  using Map = std::vector<Entry>;
  /// A scalar keeps its text; quoted scalars are always strings.
  struct Scalar {
    std::string text;
    bool quoted = false;
  };

  Node() = default;  // null
  // Defined where Entry is complete: a variant's constructors ask for that.
  Node(Scalar scalar, SourceMark mark);
  Node(List list, SourceMark mark);
  Node(Map map, SourceMark mark);

  [[nodiscard]] bool is_null() const noexcept { return value_.index() == 0; }
  [[nodiscard]] bool is_scalar() const noexcept { return value_.index() == 1; }
  [[nodiscard]] bool is_list() const noexcept { return value_.index() == 2; }
  [[nodiscard]] bool is_map() const noexcept { return value_.index() == 3; }
  [[nodiscard]] const SourceMark& mark() const noexcept { return mark_; }
  void set_mark(SourceMark mark) { mark_ = std::move(mark); }

  /// What the node is, for messages: "nothing", "a number", "a string", "a list", "a map", ...
  [[nodiscard]] std::string kind() const;

  /// The items of a list or the entries of a map; empty for anything else.
  [[nodiscard]] const List& items() const noexcept;
  [[nodiscard]] const Map& entries() const noexcept;
  [[nodiscard]] List& items();
  [[nodiscard]] Map& entries();

  /// The value of a key of a map; null pointer if there is none.
  [[nodiscard]] const Node* find(std::string_view key) const noexcept;
  [[nodiscard]] Node* find(std::string_view key) noexcept;

  /// The scalar's text; empty for anything else.
  [[nodiscard]] const std::string& text() const noexcept;

  /// Typed readings of a scalar; each fails with kConfig at this node's mark. Numbers must be
  /// finite; booleans are true, false; an integer accepts no fraction.
  [[nodiscard]] Result<bool> as_bool() const;
  [[nodiscard]] Result<std::int64_t> as_int() const;
  [[nodiscard]] Result<double> as_double() const;
  [[nodiscard]] Result<std::string> as_string() const;
  /// A list of numbers; `size` fixes its length.
  [[nodiscard]] Result<std::vector<double>> as_doubles(std::optional<std::size_t> size = {}) const;
  /// A path; a relative one is resolved against the folder of the file that names it, or
  /// against the working directory when it came from the command line.
  [[nodiscard]] Result<std::filesystem::path> as_path() const;

  /// Entry point for errors about this node: kConfig with `where` filled in.
  [[nodiscard]] Error error(std::string message, std::string hint = {}) const;

 private:
  std::variant<std::monostate, Scalar, List, Map> value_;
  SourceMark mark_;
};

struct Node::Entry {
  std::string key;
  SourceMark key_mark;
  Node value;
};

/// Reads documents from files. Implemented by the host. [any]
class DocumentReader {
 public:
  virtual ~DocumentReader() = default;

  /// Fails with kNotFound, kIo or kConfig (syntax, duplicate keys), naming file:line:col.
  [[nodiscard]] Result<Node> read(const std::filesystem::path& file) const;

  /// As read(), but goes on after mistakes that leave the rest readable (duplicate keys: the
  /// first one counts), and appends them to `errors`.
  [[nodiscard]] virtual Result<Node> read_leniently(const std::filesystem::path& file,
                                                    std::vector<Error>& errors) const = 0;
};

/// The candidate nearest to `name` by edit distance, or empty if none is near.
[[nodiscard]] std::string nearest_name(std::string_view name,
                                       const std::vector<std::string>& candidates);

/// The texts, one after the other with `separator` between them. [any]
[[nodiscard]] std::string joined(const std::vector<std::string>& texts,
                                 std::string_view separator = ", ");

/// A hint for an unknown name: "did you mean 'NAME'?" with the nearest candidate, `otherwise` if
/// none is near. [any]
[[nodiscard]] std::string did_you_mean(std::string_view name,
                                       const std::vector<std::string>& candidates,
                                       std::string otherwise = {});

}  // namespace sidestep
