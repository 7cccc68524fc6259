#include <algorithm>
#include <array>
#include <string_view>
#include <utility>
#include <vector>

#include "urdf_rules.hpp"

namespace sidestep::urdf_robot {
namespace {

/// What is not markup of elements, from its first characters to its last.
constexpr std::array<std::pair<std::string_view, std::string_view>, 4> kSkipped = {
    {{"<!--", "-->"}, {"<![CDATA[", "]]>"}, {"<?", "?>"}, {"<!", ">"}}};

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

std::size_t count_collisions(std::string_view text) {
  std::size_t count = 0;
  std::vector<std::string_view> open;  // the names of the elements around
  for (std::size_t at = text.find('<'); at < text.size(); at = text.find('<', at)) {
    const std::string_view rest = text.substr(at);
    const auto* const skipped = std::ranges::find_if(
        kSkipped, [&](const auto& ends) { return rest.starts_with(ends.first); });
    if (skipped != kSkipped.end()) {
      const std::size_t end = rest.find(skipped->second, skipped->first.size());
      at = end == std::string_view::npos ? text.size() : at + end + skipped->second.size();
      continue;
    }
    const std::size_t end = end_of_tag(text, at);
    if (rest.starts_with("</")) {
      if (!open.empty()) open.pop_back();
    } else {
      const std::size_t length = std::min(rest.find_first_of(" \t\r\n/>", 1), rest.size());
      const std::string_view name = rest.substr(1, length - 1);
      const bool is_in_link = open.size() == 2 && open[0] == "robot" && open[1] == "link";
      if (is_in_link && name == "collision") ++count;
      if (text[end - 1] == '>' && text[end - 2] != '/') open.push_back(name);
    }
    at = end;
  }
  return count;
}

}  // namespace sidestep::urdf_robot
