#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/node.hpp>

namespace sidestep {

/// Reads YAML files into Nodes. Duplicate keys, several documents and syntax errors are
/// errors with file:line:col. Anchors and aliases work; tags are refused. [any]
class YamlDocumentReader final : public DocumentReader {
 public:
  [[nodiscard]] Result<Node> read_leniently(const std::filesystem::path& file,
                                            std::vector<Error>& errors) const override;
};

/// Parses YAML text; `name` stands for the file in marks.
[[nodiscard]] Result<Node> parse_yaml(std::string_view text, const std::string& name,
                                      std::vector<Error>& errors);

/// A document as YAML text; with `origins`, each scalar's mark as a trailing comment.
[[nodiscard]] std::string to_yaml(const Node& node, bool origins);

}  // namespace sidestep
