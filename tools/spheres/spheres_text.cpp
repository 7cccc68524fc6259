#include "spheres_text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <map>
#include <optional>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

using Lines = std::vector<std::string>;

Lines split(const std::string& text) {
  Lines lines;
  std::size_t begin = 0;
  while (begin < text.size()) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

std::string text_of(const Lines& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

bool says_nothing(const std::string& line) {
  const std::size_t first = line.find_first_not_of(" \t\r");
  return first == std::string::npos || line[first] == '#';
}

/// As short as it can be read back from.
std::string number(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.begin(), text.end(), value + 0.0);
  return {text.data(), end.ptr};
}

std::string item_text(const CollisionSphere& sphere, const std::vector<Link>& links) {
  const Eigen::Vector3d& c = sphere.centre_link_m;
  return "- {link: " + links[idx(sphere.link)].name + ", centre_m: [" + number(c.x()) + ", " +
         number(c.y()) + ", " + number(c.z()) + "], radius_m: " + number(sphere.radius_m) + "}";
}

/// A sphere that the profile lists, and its lines: from 0, the last one beyond.
struct Item {
  std::string link;
  std::vector<double> numbers;  ///< Centre and radius; empty where they cannot be read.
  std::size_t first = 0, last = 0;
};

Item read_item(const Node& node) {
  Item item;
  if (const Node* const link = node.find("link")) item.link = link->text();
  const Node* const centre = node.find("centre_m");
  const Node* const radius = node.find("radius_m");
  if (centre == nullptr || radius == nullptr) return item;
  const auto p = centre->as_doubles(3);
  const auto r = radius->as_double();
  if (!p || !r) return item;
  item.numbers = *p;
  item.numbers.push_back(*r);
  return item;
}

/// Where the list stands, and its items where each begins a line of its own.
struct Block {
  std::size_t key = 0;  ///< Its line.
  std::size_t end = 0;  ///< Beyond its last line that says something.
  std::vector<Item> items;
  bool has_lines = false;
};

std::optional<Block> find_block(const Lines& lines, const Node& document) {
  Block block;
  const Node* list = nullptr;
  for (const Node::Entry& entry : document.entries()) {
    const auto line = static_cast<std::size_t>(entry.key_mark.line - 1);
    if (list == nullptr && entry.key == "spheres") {
      list = &entry.value;
      block.key = line;
      block.end = lines.size();
    } else if (list != nullptr && block.end == lines.size()) {
      block.end = line;
    }
  }
  if (list == nullptr) return std::nullopt;
  while (block.end > block.key + 1 && says_nothing(lines[block.end - 1])) --block.end;
  block.has_lines = !list->items().empty();
  for (const Node& node : list->items()) {
    Item item = read_item(node);
    item.first = static_cast<std::size_t>(node.mark().line - 1);
    const std::size_t begin = lines[item.first].find_first_not_of(' ');
    const bool begins_line = begin != std::string::npos && lines[item.first][begin] == '-';
    const std::size_t before = block.items.empty() ? block.key : block.items.back().first;
    block.has_lines = block.has_lines && begins_line && item.first > before;
    block.items.push_back(std::move(item));
  }
  for (std::size_t i = 0; block.has_lines && i < block.items.size(); ++i) {
    Item& item = block.items[i];
    item.last = i + 1 < block.items.size() ? block.items[i + 1].first : block.end;
    while (item.last > item.first + 1 && says_nothing(lines[item.last - 1])) --item.last;
  }
  return block;
}

/// Which sphere each item becomes, -1 for none; and the spheres that are new.
struct Matching {
  std::vector<int> sphere_of;
  std::vector<bool> is_same;
  std::vector<std::size_t> fresh;
};

Matching match(const std::vector<Item>& items, const std::vector<Link>& links,
               const std::vector<CollisionSphere>& spheres) {
  Matching matching{std::vector<int>(items.size(), -1), std::vector<bool>(items.size()), {}};
  std::vector<bool> is_placed(spheres.size());
  for (const bool exactly : {true, false}) {
    for (std::size_t i = 0; i < items.size(); ++i) {
      for (std::size_t s = 0; s < spheres.size() && matching.sphere_of[i] == -1; ++s) {
        const CollisionSphere& sphere = spheres[s];
        const Eigen::Vector3d& c = sphere.centre_link_m;
        const std::vector<double> numbers{c.x(), c.y(), c.z(), sphere.radius_m};
        if (is_placed[s] || links[idx(sphere.link)].name != items[i].link) {
          continue;
        }
        if (exactly && items[i].numbers != numbers) continue;
        matching.sphere_of[i] = static_cast<int>(s);
        matching.is_same[i] = exactly;
        is_placed[s] = true;
      }
    }
  }
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    if (!is_placed[s]) matching.fresh.push_back(s);
  }
  return matching;
}

/// What stands behind the sphere in its line.
std::string comment_of(const std::string& line) {
  const std::size_t brace = line.rfind('}');
  const std::size_t mark = brace == std::string::npos ? brace : line.find(" #", brace);
  if (mark == std::string::npos) return "";
  return line.substr(line.find_last_not_of(' ', mark) + 1);
}

Lines edited(const Lines& lines, const Block& block, const std::vector<Link>& links,
             const std::vector<CollisionSphere>& spheres) {
  const Matching matching = match(block.items, links, spheres);
  const std::string& model = lines[block.items.front().first];
  const std::string indent(model.find_first_not_of(' '), ' ');
  std::map<std::string, std::size_t> last_of_link;
  for (std::size_t i = 0; i < block.items.size(); ++i) last_of_link[block.items[i].link] = i;
  Lines out(lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(block.items[0].first));
  const auto add_fresh = [&](const std::string* link) {
    for (const std::size_t s : matching.fresh) {
      const std::string& name = links[idx(spheres[s].link)].name;
      const bool is_due = link == nullptr ? !last_of_link.contains(name) : name == *link;
      if (is_due) out.push_back(indent + item_text(spheres[s], links));
    }
  };
  for (std::size_t i = 0; i < block.items.size(); ++i) {
    const Item& item = block.items[i];
    const auto at = [&](std::size_t line) {
      return lines.begin() + static_cast<std::ptrdiff_t>(line);
    };
    const int sphere = matching.sphere_of[i];
    if (matching.is_same[i]) {
      out.insert(out.end(), at(item.first), at(item.last));
    } else if (sphere != -1) {
      out.push_back(indent + item_text(spheres[idx(sphere)], links) +
                    comment_of(lines[item.first]));
    }
    if (last_of_link.at(item.link) == i) add_fresh(&item.link);
    const bool is_last = i + 1 == block.items.size();
    if (is_last) add_fresh(nullptr);
    out.insert(out.end(), at(item.last), is_last ? lines.end() : at(block.items[i + 1].first));
  }
  return out;
}

}  // namespace

std::string with_spheres(const std::string& text, const Node& document,
                         const std::vector<Link>& links,
                         const std::vector<CollisionSphere>& spheres) {
  Lines lines = split(text);
  const auto block = find_block(lines, document);
  if (block && block->has_lines) return text_of(edited(lines, *block, links, spheres));
  Lines fresh{"spheres:"};
  for (const CollisionSphere& sphere : spheres) fresh.push_back("  " + item_text(sphere, links));
  if (!block) {
    if (!lines.empty() && !lines.back().empty()) lines.emplace_back();
    lines.insert(lines.end(), fresh.begin(), fresh.end());
    return text_of(lines);
  }
  Lines out(lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(block->key));
  out.insert(out.end(), fresh.begin(), fresh.end());
  out.insert(out.end(), lines.begin() + static_cast<std::ptrdiff_t>(block->end), lines.end());
  return text_of(out);
}

std::string with_path(const std::string& text, const Node& scalar, const std::string& path) {
  Lines lines = split(text);
  const auto row = static_cast<std::size_t>(scalar.mark().line - 1);
  const auto column = static_cast<std::size_t>(scalar.mark().column - 1);
  if (row >= lines.size() || column >= lines[row].size()) return text;
  std::string& line = lines[row];
  const char quote = line[column];
  const bool is_quoted = quote == '"' || quote == '\'';
  const std::size_t end =
      is_quoted ? line.find(quote, column + 1) : column + scalar.text().size() - 1;
  if (end >= line.size()) return text;
  line.replace(column, end + 1 - column, "\"" + path + "\"");
  return text_of(lines);
}

}  // namespace sidestep
