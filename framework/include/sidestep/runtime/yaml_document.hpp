#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include <sidestep/core/node.hpp>

namespace sidestep {

/// Reads YAML files into Nodes. Duplicate keys, several documents and syntax errors are
/// errors with file:line:col. Anchors and aliases work; tags are refused. [any]
class YamlDocumentReader final : public DocumentReader {
 public:
  [[nodiscard]] Result<Node> read(const std::filesystem::path& file) const override;
  /// `name` stands for the file in marks. Relative paths in it resolve against the working
  /// directory.
  [[nodiscard]] Result<Node> parse(std::string_view text, const std::string& name) const;
};

/// A document as YAML text; with `origins`, each scalar's mark as a trailing comment.
[[nodiscard]] std::string to_yaml(const Node& node, bool origins);

}  // namespace sidestep
