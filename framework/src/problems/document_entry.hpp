#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>

namespace sidestep {

/// A value of a YAML document that remembers the way to it, so that reading needs no check a line:
/// the first thing that is missing or not what it should be becomes the error, with file, line and
/// column, and reads as zero or empty. (JsonEntry is the same for JSON.)
class DocumentEntry {
 public:
  /// The whole document. Both must outlive the entry and what it leads to.
  DocumentEntry(const Node& document, std::optional<Error>& error)
      : node_(&document), error_(&error) {}

  /// Whether there is such a value, and it is not null or an empty list.
  [[nodiscard]] bool has(const char* key) const;
  /// A value of a map.
  [[nodiscard]] DocumentEntry operator[](const char* key) const;
  /// All values of a list.
  [[nodiscard]] std::vector<DocumentEntry> items() const;
  [[nodiscard]] bool is_map() const { return node_ != nullptr && node_->is_map(); }
  /// Complains where a map has any other key.
  void expect_keys(const std::vector<std::string>& known) const;

  [[nodiscard]] double number() const;
  [[nodiscard]] std::string text() const;
  /// A list of so many numbers.
  [[nodiscard]] Eigen::VectorXd numbers(std::size_t count) const;

  /// Makes this the error, unless there is one already.
  void complain(const std::string& message, const std::string& hint = {}) const;

 private:
  DocumentEntry(const Node* node, std::optional<Error>* error, std::string path)
      : node_(node), error_(error), path_(std::move(path)) {}
  /// Whether the node is there and `is`; complains where it is there and is not.
  [[nodiscard]] bool expect(bool is, const std::string& what) const;
  template <class Value>
  void keep_error(const Result<Value>& value) const {
    if (!value) complain(value.error().message, value.error().hint);
  }

  const Node* node_;  ///< Null where something on the way was missing.
  std::optional<Error>* error_;
  std::string path_;  ///< E.g. "world.collision_objects[3].id".
};

/// A value of a JSON file that remembers the way to it, so that reading needs no check a line: the
/// first thing that is missing or not what it should be becomes the file's error, and reads as
/// zero or empty.
class JsonEntry {
 public:
  /// What all entries of a file share.
  struct File {
    std::string name;
    nlohmann::json content;
    std::optional<Error> error;
  };

  /// Reads and parses. Fails with kNotFound, kIo, or kConfig naming line and column, or the key
  /// that an object has twice.
  [[nodiscard]] static Result<File> read(const std::string& file_name);

  /// The whole file, which must outlive the entry.
  explicit JsonEntry(File& file) : file_(&file), value_(&file.content) {}

  [[nodiscard]] bool has(const char* key) const;
  /// Complains where an object has any other key.
  void expect_keys(const std::vector<std::string>& known) const;
  /// A value of an object.
  [[nodiscard]] JsonEntry operator[](const char* key) const;
  /// A value of an array.
  [[nodiscard]] JsonEntry at(std::size_t index) const;
  /// All values of an array.
  [[nodiscard]] std::vector<JsonEntry> items() const;
  [[nodiscard]] std::size_t size() const;

  [[nodiscard]] double number() const;
  /// A number above 0.
  [[nodiscard]] double positive() const;
  [[nodiscard]] int integer(int least, int most) const;
  /// true, false, 1 or 0.
  [[nodiscard]] bool flag() const;
  [[nodiscard]] std::string text() const;
  /// An array of so many numbers.
  [[nodiscard]] Eigen::VectorXd numbers(std::size_t count) const;
  [[nodiscard]] Eigen::Vector3d vector3() const { return numbers(3); }

  /// Makes this the error, unless there is one already.
  void complain(const std::string& message) const;

 private:
  JsonEntry(File& file, const nlohmann::json* value, std::string path)
      : file_(&file), value_(value), path_(std::move(path)) {}
  [[nodiscard]] std::string kind() const;
  [[nodiscard]] bool expect(bool is, const char* what) const;

  File* file_;
  const nlohmann::json* value_;  ///< Null where something on the way was missing.
  std::string path_;             ///< E.g. "runs[0].results[3]".
};

}  // namespace sidestep
