#include <sidestep/core/xml_tags.hpp>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace sidestep {
namespace {

constexpr std::size_t kDeepestElement = 200;

/// Behind the '>' that ends a tag; those in quoted values do not.
std::size_t end_of_tag(std::string_view text, std::size_t at) {
  char quote = '\0';
  for (; at < text.size(); ++at) {
    const char c = text[at];
    if (quote != '\0') {
      if (c == quote) quote = '\0';
    } else if (c == '"' || c == '\'') {
      quote = c;
    } else if (c == '>') {
      return at + 1;
    }
  }
  return text.size();
}

}  // namespace

void visit_elements(std::string_view text, std::string_view end_of_instruction,
                    const std::function<void(std::span<const std::string_view> names)>& visit) {
  // What is not markup of elements, from its first characters to its last.
  const std::array<std::pair<std::string_view, std::string_view>, 4> skipped_parts = {
      {{"<!--", "-->"}, {"<![CDATA[", "]]>"}, {"<?", end_of_instruction}, {"<!", ">"}}};
  std::vector<std::string_view> open;
  for (std::size_t at = text.find('<'); at < text.size(); at = text.find('<', at)) {
    const std::string_view rest = text.substr(at);
    const auto* const skipped = std::ranges::find_if(
        skipped_parts, [&](const auto& ends) { return rest.starts_with(ends.first); });
    if (skipped != skipped_parts.end()) {
      const std::size_t end = rest.find(skipped->second, skipped->first.size());
      at = end == std::string_view::npos ? text.size() : at + end + skipped->second.size();
      continue;
    }
    const std::size_t end = end_of_tag(text, at);
    if (rest.starts_with("</")) {
      if (!open.empty()) open.pop_back();
    } else {
      const std::size_t length = std::min(rest.find_first_of(" \t\r\n/>", 1), rest.size());
      open.push_back(rest.substr(1, length - 1));
      visit(open);
      if (text[end - 1] != '>' || text[end - 2] == '/') open.pop_back();
    }
    at = end;
  }
}

Result<void> check_xml_depth(std::string_view text, const std::string& file) {
  std::size_t deepest = 0;
  const char* too_deep = nullptr;  // behind the '<' of the first that is
  // TinyXML ends an instruction at the first '>'.
  visit_elements(text, ">", [&](auto names) {
    deepest = std::max(deepest, names.size());
    if (deepest > kDeepestElement && too_deep == nullptr) too_deep = names.back().data();
  });
  if (too_deep == nullptr) return {};
  const std::string_view before(text.data(), static_cast<std::size_t>(too_deep - text.data()));
  const auto column = before.size() - (before.rfind('\n') + 1);  // npos + 1 is 0
  return fail(ErrorCode::kConfig,
              "XML elements are nested " + std::to_string(deepest) + " deep; " +
                  std::to_string(kDeepestElement) + " at most are read",
              file + ":" + std::to_string(1 + std::ranges::count(before, '\n')) + ":" +
                  std::to_string(column));
}

}  // namespace sidestep
