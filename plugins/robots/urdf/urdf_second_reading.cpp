#include "urdf_second_reading.hpp"

#include <algorithm>
#include <cmath>
#include <locale>
#include <map>
#include <sstream>
#include <string>
#include <utility>

namespace sidestep::urdf_robot {
namespace {

using Attributes = std::map<std::string, std::string, std::less<>>;

/// A <collision> as the text has it.
struct WrittenShape {
  Attributes origin;
  std::string kind;
  Attributes geometry;
};

/// `&amp;` and the like, of which names of files may have some.
std::string unescaped(std::string text) {
  constexpr std::pair<std::string_view, char> kEntities[] = {
      {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}, {"&amp;", '&'}};
  for (std::size_t at = text.find('&'); at != std::string::npos; at = text.find('&', at + 1)) {
    for (const auto& [entity, letter] : kEntities) {
      if (text.compare(at, entity.size(), entity) != 0) continue;
      text.replace(at, entity.size(), 1, letter);
      break;
    }
  }
  return text;
}

/// One pass over a text, tag by tag.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}

  /// By the names of links.
  std::map<std::string, std::vector<WrittenShape>> run() {
    while (skip_to('<')) {
      if (skip("<!--", "-->") || skip("<![CDATA[", "]]>") || skip("<?", "?>") || skip("<!", ">")) {
        continue;
      }
      if (text_[at_ + 1 < text_.size() ? at_ + 1 : at_] == '/') {
        if (!open_.empty()) open_.pop_back();
        skip_to('>');
      } else {
        read_tag();
      }
    }
    return std::move(shapes_);
  }

 private:
  bool skip_to(char c) {
    while (at_ < text_.size() && text_[at_] != c) ++at_;
    return at_ < text_.size();
  }
  bool skip(std::string_view begin, std::string_view end) {
    if (text_.substr(at_, begin.size()) != begin) return false;
    const std::size_t found = text_.find(end, at_ + begin.size());
    at_ = found == std::string_view::npos ? text_.size() : found + end.size();
    return true;
  }
  [[nodiscard]] bool is_space() const {
    return text_[at_] == ' ' || text_[at_] == '\t' || text_[at_] == '\n' || text_[at_] == '\r';
  }

  std::string word() {
    const std::size_t begin = at_;
    while (at_ < text_.size() && !is_space() && text_[at_] != '=' && text_[at_] != '>' &&
           text_[at_] != '/') {
      ++at_;
    }
    return std::string(text_.substr(begin, at_ - begin));
  }

  void read_tag() {
    ++at_;
    open_.push_back(word());
    Attributes attributes;
    bool is_empty = false;
    while (at_ < text_.size() && text_[at_] != '>') {
      is_empty = text_[at_] == '/';
      if (is_empty || is_space() || text_[at_] == '=') {
        ++at_;
        continue;
      }
      const std::string name = word();
      while (at_ < text_.size() && (is_space() || text_[at_] == '=')) ++at_;
      if (at_ == text_.size()) return;
      const char quote = text_[at_];
      const std::size_t begin = ++at_;
      skip_to(quote);
      attributes[name] = unescaped(std::string(text_.substr(begin, at_ - begin)));
      if (at_ < text_.size()) ++at_;
    }
    take(std::move(attributes));
    if (is_empty) open_.pop_back();
  }

  void take(Attributes attributes) {
    const auto is = [&](std::initializer_list<std::string_view> path) {
      return std::equal(open_.begin(), open_.end(), path.begin(), path.end());
    };
    if (is({"robot", "link"})) link_ = attributes["name"];
    if (is({"robot", "link", "collision"})) shapes_[link_].emplace_back();
    if (shapes_[link_].empty()) return;
    WrittenShape& shape = shapes_[link_].back();
    if (is({"robot", "link", "collision", "origin"})) shape.origin = std::move(attributes);
    const bool is_geometry = open_.size() == 5 && open_[2] == "collision" && open_[3] == "geometry";
    if (!is_geometry) return;
    shape.kind = open_[4];
    shape.geometry = std::move(attributes);
  }

  std::string_view text_;
  std::size_t at_ = 0;
  std::vector<std::string> open_;
  std::string link_;
  std::map<std::string, std::vector<WrittenShape>> shapes_;
};

/// Numbers apart by spaces; those that are not there are as `otherwise`.
std::vector<double> numbers(const Attributes& attributes, const char* name, std::size_t count,
                            double otherwise) {
  std::vector<double> values;
  const auto found = attributes.find(name);
  std::istringstream text(found == attributes.end() ? "" : found->second);
  text.imbue(std::locale::classic());
  for (double value = 0.0; text >> value;) values.push_back(value);
  values.resize(std::max(values.size(), count), otherwise);
  return values;
}

bool are_near(const std::vector<double>& written, std::initializer_list<double> read) {
  if (written.size() != read.size()) return false;
  return std::equal(read.begin(), read.end(), written.begin(), [](double a, double b) {
    return std::abs(a - b) <= 1e-9 * std::max(1.0, std::abs(b));
  });
}

/// Fixed axes: about x, then y, then z.
bool is_at(const Transform& T, const Attributes& origin) {
  const auto xyz = numbers(origin, "xyz", 3, 0.0), rpy = numbers(origin, "rpy", 3, 0.0);
  if (xyz.size() != 3 || rpy.size() != 3) return false;
  const double cr = std::cos(rpy[0]), sr = std::sin(rpy[0]), cp = std::cos(rpy[1]),
               sp = std::sin(rpy[1]), cy = std::cos(rpy[2]), sy = std::sin(rpy[2]);
  const std::vector<double> R{cy * cp,
                              cy * sp * sr - sy * cr,
                              cy * sp * cr + sy * sr,
                              sy * cp,
                              sy * sp * sr + cy * cr,
                              sy * sp * cr - cy * sr,
                              -sp,
                              cp * sr,
                              cp * cr};
  const auto p = T.translation();
  const Eigen::Matrix3d& read = T.linear();
  return are_near(xyz, {p.x(), p.y(), p.z()}) &&
         are_near(R, {read(0, 0), read(0, 1), read(0, 2), read(1, 0), read(1, 1), read(1, 2),
                      read(2, 0), read(2, 1), read(2, 2)});
}

bool is_same(const UrdfShape& read, const WrittenShape& written) {
  if (!is_at(read.T_link_shape, written.origin)) return false;
  const auto of = [&](const char* name, std::size_t count, double otherwise = 0.0) {
    return numbers(written.geometry, name, count, otherwise);
  };
  if (!read.mesh_uri.empty()) {
    const auto file = written.geometry.find("filename");
    const Eigen::Vector3d& scale = read.mesh_scale;
    return written.kind == "mesh" && file != written.geometry.end() &&
           file->second == read.mesh_uri &&
           are_near(of("scale", 3, 1.0), {scale.x(), scale.y(), scale.z()});
  }
  if (const auto* box = std::get_if<Box>(&read.shape)) {
    return written.kind == "box" &&
           are_near(of("size", 3), {box->size_m.x(), box->size_m.y(), box->size_m.z()});
  }
  if (const auto* ball = std::get_if<Sphere>(&read.shape)) {
    return written.kind == "sphere" && are_near(of("radius", 1), {ball->radius_m});
  }
  const auto* cylinder = std::get_if<Cylinder>(&read.shape);
  return cylinder != nullptr && written.kind == "cylinder" &&
         are_near(of("radius", 1), {cylinder->radius_m}) &&
         are_near(of("length", 1), {cylinder->length_m});
}

}  // namespace

void check_second_reading(const UrdfModel& model, std::string_view text,
                          std::vector<Error>& errors) {
  auto written = Scanner(text).run();
  for (const UrdfLink& link : model.links) {
    const std::vector<WrittenShape>& shapes = written[link.name];
    for (std::size_t i = 0; i < link.shapes.size(); ++i) {
      if (i < shapes.size() && is_same(link.shapes[i], shapes[i])) continue;
      errors.push_back({ErrorCode::kConfig,
                        "two readings of collision shape " + std::to_string(i + 1) + " of link '" +
                            link.name + "' differ",
                        link.shapes[i].mark.to_string(),
                        "write the file more plainly: what one reader takes for another shape, "
                        "others may, too"});
    }
  }
}

}  // namespace sidestep::urdf_robot
