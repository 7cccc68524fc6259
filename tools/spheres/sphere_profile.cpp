#include "sphere_profile.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <iterator>
#include <map>
#include <optional>
#include <sstream>
#include <tuple>
#include <utility>

#include <sidestep/core/file.hpp>
#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "load_robot.hpp"

namespace sidestep {
namespace {

using Lines = std::vector<std::string>;

Lines split(const std::string& text) {
  std::istringstream in(text);
  Lines lines;
  for (std::string line; std::getline(in, line);) lines.push_back(std::move(line));
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

/// As short as it can be read back from, and no -0.
std::string number(double value) { return detail::number_text(value + 0.0); }

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
        if (is_placed[s] || links[idx(sphere.link)].name != items[i].link) continue;
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
      if (is_due) out.push_back(indent + sphere_item(spheres[s], links));
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
      out.push_back(indent + sphere_item(spheres[idx(sphere)], links) +
                    comment_of(lines[item.first]));
    }
    if (last_of_link.at(item.link) == i) add_fresh(&item.link);
    const bool is_last = i + 1 == block.items.size();
    if (is_last) add_fresh(nullptr);
    out.insert(out.end(), at(item.last), is_last ? lines.end() : at(block.items[i + 1].first));
  }
  return out;
}

namespace fs = std::filesystem;

constexpr double kMostMetres = 100.0;

Result<std::shared_ptr<const KinematicTree>> load(const fs::path& file,
                                                  const HostContext& context) {
  urdf_robot::Options options;
  options.profile = Node(Node::Scalar{file.string(), true}, {"command line"});
  auto robot = SIDESTEP_TRY(urdf_robot::load_robot(options, context));
  return std::shared_ptr<const KinematicTree>(std::move(robot));
}

Result<void> check_spheres(const std::vector<CollisionSphere>& spheres,
                           const RobotDescription& robot) {
  const auto wrong = [&](const CollisionSphere& one) {
    return one.link < 0 || one.link >= static_cast<int>(robot.links.size()) ||
           !one.centre_link_m.allFinite() ||
           one.centre_link_m.cwiseAbs().maxCoeff() > kMostMetres ||
           !(one.radius_m >= 1e-6 && one.radius_m <= kMostMetres);
  };
  if (spheres.empty()) return invalid("a robot needs a sphere at least");
  if (std::ranges::any_of(spheres, wrong)) {
    return invalid("a sphere lies on no link, or its centre or radius is out of bounds");
  }
  return {};
}

auto key(const CollisionSphere& one) {
  return std::tuple(one.link, one.centre_link_m.x(), one.centre_link_m.y(), one.centre_link_m.z(),
                    one.radius_m);
}

bool are_same(std::vector<CollisionSphere> a, std::vector<CollisionSphere> b) {
  std::ranges::sort(a, {}, key);
  std::ranges::sort(b, {}, key);
  return std::ranges::equal(a, b, {}, key, key);
}

/// All that a profile says, but its spheres and, where it moved, its paths.
std::string all_else(const Node& document, bool has_moved) {
  Node rest = document;
  std::erase_if(rest.entries(), [&](const Node::Entry& entry) {
    const bool is_path = entry.key == "urdf" || entry.key == "package_paths";
    return entry.key == "spheres" || (has_moved && is_path);
  });
  return to_yaml(rest, false);
}

tl::unexpected<Error> not_writable(const fs::path& file, int error) {
  return fail(ErrorCode::kIo, std::string("cannot be written: ") + std::strerror(error),
              file.string(), "copy the profile's folder to a place of your own, or use --out FILE");
}

/// A new file beside another one, which is removed unless it has taken its place.
class FreshFile {
 public:
  explicit FreshFile(fs::path place) : place_(std::move(place)) {
    file_ = place_.parent_path() /
            ("." + place_.filename().string() + "." + std::to_string(getpid()) + ".new");
  }
  ~FreshFile() {
    if (!is_placed_) unlink(file_.c_str());
  }
  FreshFile(const FreshFile&) = delete;
  FreshFile& operator=(const FreshFile&) = delete;

  [[nodiscard]] const fs::path& file() const noexcept { return file_; }

  [[nodiscard]] Result<void> write(const std::string& text, mode_t mode) const {
    unlink(file_.c_str());
    const int out = open(file_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
    if (out < 0) return not_writable(place_, errno);
    std::size_t done = 0;
    int error = fchmod(out, mode) == 0 ? 0 : errno;
    while (error == 0 && done < text.size()) {
      const ssize_t count = ::write(out, text.data() + done, text.size() - done);
      if (count > 0) done += static_cast<std::size_t>(count);
      if (count < 0 && errno != EINTR) error = errno;
    }
    if (error == 0 && fsync(out) != 0) error = errno;
    if (close(out) != 0 && error == 0) error = errno;
    if (error != 0) return not_writable(place_, error);
    return {};
  }

  [[nodiscard]] Result<void> take_place() {
    if (rename(file_.c_str(), place_.c_str()) != 0) return not_writable(place_, errno);
    is_placed_ = true;
    return {};
  }

 private:
  fs::path place_;
  fs::path file_;
  bool is_placed_ = false;
};

}  // namespace

std::string sphere_item(const CollisionSphere& sphere, const std::vector<Link>& links) {
  const Eigen::Vector3d& c = sphere.centre_link_m;
  return "- {link: " + links[idx(sphere.link)].name + ", centre_m: [" + number(c.x()) + ", " +
         number(c.y()) + ", " + number(c.z()) + "], radius_m: " + number(sphere.radius_m) + "}";
}

std::string with_spheres(const std::string& text, const Node& document,
                         const std::vector<Link>& links,
                         const std::vector<CollisionSphere>& spheres) {
  Lines lines = split(text);
  const auto block = find_block(lines, document);
  if (block && block->has_lines) return text_of(edited(lines, *block, links, spheres));
  Lines fresh{"spheres:"};
  for (const CollisionSphere& sphere : spheres) fresh.push_back("  " + sphere_item(sphere, links));
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

Result<SphereProfile> SphereProfile::open(const std::string& name,
                                          const std::optional<fs::path>& out,
                                          const HostContext& context) {
  const Node node(Node::Scalar{name, true}, {"command line"});
  const auto found = SIDESTEP_TRY(urdf_robot::find_profile(node, context.robot_paths));
  std::error_code error;
  fs::path source = fs::canonical(found, error);
  if (error) return fail(ErrorCode::kIo, error.message(), found.string());
  fs::path target = source;
  if (out) {
    target = fs::absolute(*out, error).lexically_normal();
    if (fs::exists(fs::symlink_status(target, error))) {
      return fail(ErrorCode::kIo, "there is such a file already", out->string(), "name a new one");
    }
  }
  SphereProfile profile(std::move(source), std::move(target), context);
  SIDESTEP_TRY(profile.read());
  return profile;
}

Result<void> SphereProfile::read() {
  auto text = SIDESTEP_TRY(read_file(source_));
  auto robot = SIDESTEP_TRY(load(source_, *context_));
  text_ = std::move(text);
  robot_ = std::move(robot);
  return {};
}

std::string SphereProfile::revision() const {
  std::uint64_t hash = 0xcbf29ce484222325;  // FNV-1a
  for (const char c : text_) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return format("%016llx", static_cast<unsigned long long>(hash));
}

Result<void> SphereProfile::check_writable() const {
  if (access(target_.parent_path().c_str(), W_OK | X_OK) != 0) return not_writable(target_, errno);
  struct stat state {};
  if (stat(target_.c_str(), &state) != 0) return {};
  // For root, too, a file that nobody may write is not meant to be written.
  const bool is_protected = (state.st_mode & (S_IWUSR | S_IWGRP | S_IWOTH)) == 0;
  if (is_protected || access(target_.c_str(), W_OK) != 0) return not_writable(target_, EACCES);
  return {};
}

Result<std::string> SphereProfile::text_with(const std::vector<CollisionSphere>& spheres) const {
  std::vector<Error> errors;
  const auto document = SIDESTEP_TRY(parse_yaml(text_, source_.string(), errors));
  std::string text = with_spheres(text_, document, robot_->description().links, spheres);
  const fs::path folder = target_.parent_path();
  if (folder == source_.parent_path()) return text;
  // Elsewhere, relative paths lead elsewhere. Positions are the new text's.
  const auto moved = SIDESTEP_TRY(parse_yaml(text, source_.string(), errors));
  std::vector<const Node*> paths;
  if (const Node* const packages = moved.find("package_paths")) {
    for (const Node& item : packages->items()) {
      if (!item.is_map()) paths.push_back(&item);
      for (const Node::Entry& entry : item.entries()) paths.push_back(&entry.value);
    }
  }
  if (const Node* const urdf = moved.find("urdf")) paths.push_back(urdf);
  std::ranges::sort(paths, std::ranges::greater{}, [](const Node* node) {
    return std::pair(node->mark().line, node->mark().column);
  });
  for (const Node* const node : paths) {
    const fs::path path = (source_.parent_path() / node->text()).lexically_normal();
    text = with_path(text, *node, path.lexically_proximate(folder).string());
  }
  return text;
}

Result<void> SphereProfile::save(const std::vector<CollisionSphere>& spheres) {
  SIDESTEP_TRY(check_spheres(spheres, robot_->description()));
  SIDESTEP_TRY(check_writable());
  const auto now = SIDESTEP_TRY(read_file(source_));
  if (now != text_) {
    return fail(ErrorCode::kIo, "the profile was changed meanwhile by somebody else",
                source_.string(), "load it again");
  }
  const auto text = SIDESTEP_TRY(text_with(spheres));
  return replace_target(text, spheres);
}

Result<void> SphereProfile::replace_target(const std::string& text,
                                           const std::vector<CollisionSphere>& spheres) {
  struct stat state {};
  const mode_t mode = stat(source_.c_str(), &state) == 0 ? state.st_mode & 0777 : 0644;
  FreshFile fresh(target_);
  SIDESTEP_TRY(fresh.write(text, mode | S_IWUSR));
  // Nothing takes the profile's place that does not say what it should.
  auto robot = SIDESTEP_TRY(load(fresh.file(), *context_));
  std::vector<Error> errors;
  const auto before = parse_yaml(text_, source_.string(), errors);
  const auto after = parse_yaml(text, target_.string(), errors);
  const bool has_moved = target_.parent_path() != source_.parent_path();
  const bool is_right = before && after && are_same(robot->description().spheres, spheres) &&
                        all_else(*before, has_moved) == all_else(*after, has_moved);
  if (!is_right) {
    return fail(ErrorCode::kConfig, "the spheres cannot be written into this profile's text",
                source_.string(), "list one sphere a line under 'spheres'");
  }
  SIDESTEP_TRY(fresh.take_place());
  source_ = target_;
  text_ = text;
  robot_ = std::move(robot);
  return {};
}

}  // namespace sidestep
