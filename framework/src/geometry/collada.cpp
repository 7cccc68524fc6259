#include "collada.hpp"

#include <tinyxml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>

#include <sidestep/core/index.hpp>
#include <sidestep/core/xml_tags.hpp>

#include "mesh_text.hpp"

namespace sidestep {
namespace {

/// Nodes within nodes: more are a circle.
constexpr int kDeepestNode = 100;
/// Of all nodes and numbers, each as often as it is named: few lines that name each other twice can
/// stand for billions.
constexpr std::size_t kMostElements = 200'000;
constexpr std::size_t kMostNumbers = 100'000'000;

class ColladaReader {
 public:
  explicit ColladaReader(const std::string& file) : file_(file) {}

  [[nodiscard]] Result<Mesh> run(const std::string& text) {
    SIDESTEP_TRY(check_xml_depth(text, file_));
    TiXmlDocument document;
    document.Parse(text.c_str());
    if (document.Error()) {
      return fail(ErrorCode::kConfig, document.ErrorDesc(), place(document.ErrorRow()));
    }
    const TiXmlElement* const root = document.RootElement();
    if (root == nullptr || root->ValueStr() != "COLLADA") {
      return fail(ErrorCode::kConfig, "this is no COLLADA: its root is not <COLLADA>", file_);
    }
    collect(*root);
    double metres = 1.0;
    const TiXmlElement* const asset = root->FirstChildElement("asset");
    const TiXmlElement* const unit = asset != nullptr ? asset->FirstChildElement("unit") : nullptr;
    if (const char* const said = unit != nullptr ? unit->Attribute("meter") : nullptr) {
      metres = number<double>(said).value_or(0.0);
      if (!(metres > 0.0 && std::isfinite(metres))) {
        return wrong(*unit, "a unit has more than 0 metres");
      }
    }
    const TiXmlElement* const scene = root->FirstChildElement("scene");
    if (scene == nullptr) return wrong(*root, "there is no <scene>");
    for (const TiXmlElement* of = scene->FirstChildElement("instance_visual_scene"); of != nullptr;
         of = of->NextSiblingElement("instance_visual_scene")) {
      const TiXmlElement* const shown = SIDESTEP_TRY(named(*of, "url", "visual_scene"));
      SIDESTEP_TRY(add_nodes(*shown, Eigen::Affine3d(Eigen::Scaling(metres)), 0));
    }
    return std::move(mesh_);
  }

 private:
  [[nodiscard]] std::string place(int line) const { return file_ + ":" + std::to_string(line); }
  [[nodiscard]] tl::unexpected<Error> wrong(const TiXmlElement& where, std::string what) const {
    return fail(ErrorCode::kConfig, std::move(what), place(where.Row()));
  }

  void collect(const TiXmlElement& element) {
    if (const char* const id = element.Attribute("id")) elements_.try_emplace(id, &element);
    for (const TiXmlElement* child = element.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      collect(*child);
    }
  }

  /// The element that an attribute "#id" names.
  [[nodiscard]] Result<const TiXmlElement*> named(const TiXmlElement& by, const char* attribute,
                                                  std::string_view tag) const {
    const char* const text = by.Attribute(attribute);
    const std::string url = text != nullptr ? text : "";
    const auto found = url.starts_with('#') ? elements_.find(url.substr(1)) : elements_.end();
    if (found != elements_.end() && found->second->ValueStr() == tag) return found->second;
    return wrong(by, "'" + url + "' names no <" + std::string(tag) + "> of this file");
  }

  template <class T>
  [[nodiscard]] Result<std::vector<T>> numbers(const TiXmlElement& element) {
    std::vector<T> values;
    const char* const text = element.GetText();
    for (const std::string_view word : split(text != nullptr ? text : "")) {
      const auto value = number<T>(word);
      if (!value || !std::isfinite(static_cast<double>(*value))) {
        return wrong(element, "'" + std::string(word) + "' is not a finite number");
      }
      values.push_back(*value);
    }
    numbers_ += values.size();
    if (numbers_ > kMostNumbers) return wrong(element, "it names too many numbers in all");
    return values;
  }
  [[nodiscard]] Result<std::vector<double>> numbers(const TiXmlElement& element,
                                                    std::size_t count) {
    auto values = SIDESTEP_TRY(numbers<double>(element));
    if (values.size() == count) return values;
    return wrong(element, "<" + element.ValueStr() + "> has " + std::to_string(count) +
                              " numbers, here " + std::to_string(values.size()));
  }
  /// An attribute that is a whole number from 0 on.
  [[nodiscard]] Result<std::size_t> count(const TiXmlElement& element, const char* attribute,
                                          std::size_t otherwise) const {
    const char* const text = element.Attribute(attribute);
    if (text == nullptr) return otherwise;
    if (const auto value = number<std::uint32_t>(text)) return std::size_t{*value};
    return wrong(element, "'" + std::string(text) + "' is not a whole number");
  }

  [[nodiscard]] Result<void> add_nodes(const TiXmlElement& parent, Eigen::Affine3d T, int depth) {
    if (depth > kDeepestNode) return wrong(parent, "nodes stand within themselves");
    for (const TiXmlElement* child = parent.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      if (++elements_visited_ > kMostElements)
        return wrong(*child, "it names too many nodes in all");
      const std::string& tag = child->ValueStr();
      if (tag == "matrix") {
        const auto rows = SIDESTEP_TRY(numbers(*child, 16));
        T = T * Eigen::Affine3d(
                    Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows.data()));
      } else if (tag == "translate") {
        const auto xyz = SIDESTEP_TRY(numbers(*child, 3));
        T.translate(Eigen::Vector3d(xyz[0], xyz[1], xyz[2]));
      } else if (tag == "rotate") {
        const auto turn = SIDESTEP_TRY(numbers(*child, 4));
        const Eigen::Vector3d axis(turn[0], turn[1], turn[2]);
        T.rotate(Eigen::AngleAxisd(turn[3] * std::numbers::pi / 180.0, axis.stableNormalized()));
      } else if (tag == "scale") {
        const auto by = SIDESTEP_TRY(numbers(*child, 3));
        T.scale(Eigen::Vector3d(by[0], by[1], by[2]));
      } else if (tag == "node") {
        SIDESTEP_TRY(add_nodes(*child, T, depth + 1));
      } else if (tag == "instance_node") {
        const TiXmlElement* const node = SIDESTEP_TRY(named(*child, "url", "node"));
        SIDESTEP_TRY(add_nodes(*node, T, depth + 1));
      } else if (tag == "instance_geometry") {
        const TiXmlElement* const geometry = SIDESTEP_TRY(named(*child, "url", "geometry"));
        SIDESTEP_TRY(add_geometry(*geometry, T));
      } else if (tag == "instance_controller" || tag == "skew" || tag == "lookat") {
        return wrong(*child, "<" + tag + "> is not read");
      }
    }
    return {};
  }

  [[nodiscard]] Result<void> add_geometry(const TiXmlElement& geometry, const Eigen::Affine3d& T) {
    const TiXmlElement* const mesh = geometry.FirstChildElement("mesh");
    if (mesh == nullptr) return wrong(geometry, "a geometry without <mesh> is not read");
    for (const TiXmlElement* part = mesh->FirstChildElement(); part != nullptr;
         part = part->NextSiblingElement()) {
      static constexpr std::array kWithoutArea{"source", "vertices", "extra", "lines",
                                               "linestrips"};
      if (std::ranges::count(kWithoutArea, part->ValueStr()) > 0) continue;
      SIDESTEP_TRY(add_faces(*part, T));
    }
    return {};
  }

  /// The points that an input VERTEX names.
  [[nodiscard]] Result<std::vector<Eigen::Vector3d>> points(const TiXmlElement& input) {
    const TiXmlElement* const vertices = SIDESTEP_TRY(named(input, "source", "vertices"));
    const TiXmlElement* position = vertices->FirstChildElement("input");
    while (position != nullptr &&
           std::string_view("POSITION") != attribute(*position, "semantic")) {
      position = position->NextSiblingElement("input");
    }
    if (position == nullptr) return wrong(*vertices, "there is no input POSITION");
    const TiXmlElement* const source = SIDESTEP_TRY(named(*position, "source", "source"));
    const TiXmlElement* const array = source->FirstChildElement("float_array");
    if (array == nullptr) return wrong(*source, "there is no <float_array>");
    const TiXmlElement* const technique = source->FirstChildElement("technique_common");
    const TiXmlElement* const accessor =
        technique != nullptr ? technique->FirstChildElement("accessor") : nullptr;
    if (accessor == nullptr) return wrong(*source, "there is no <accessor>");
    const auto all = SIDESTEP_TRY(numbers(*array, SIDESTEP_TRY(count(*array, "count", 0))));
    const std::size_t stride = SIDESTEP_TRY(count(*accessor, "stride", 1));
    const std::size_t first = SIDESTEP_TRY(count(*accessor, "offset", 0));
    const std::size_t wanted = SIDESTEP_TRY(count(*accessor, "count", 0));
    if (stride < 3 || first + wanted * stride > all.size()) {
      return wrong(*accessor, "its points are not all in the <float_array>, three numbers each");
    }
    std::vector<Eigen::Vector3d> points(wanted);
    for (std::size_t i = 0; i < points.size(); ++i) {
      points[i] = Eigen::Vector3d::Map(&all[first + i * stride]);
    }
    return points;
  }
  [[nodiscard]] static std::string_view attribute(const TiXmlElement& element, const char* name) {
    const char* const text = element.Attribute(name);
    return text != nullptr ? text : "";
  }

  /// The polygons of <triangles>, <polylist> or <polygons>, in triangles.
  [[nodiscard]] Result<void> add_faces(const TiXmlElement& part, const Eigen::Affine3d& T) {
    const std::string& tag = part.ValueStr();
    static constexpr std::array kTags{"triangles", "polylist", "polygons"};
    if (std::ranges::count(kTags, tag) == 0) return wrong(part, "<" + tag + "> is not read");
    std::size_t stride = 1, offset = 0;
    const TiXmlElement* corners = nullptr;
    for (const TiXmlElement* input = part.FirstChildElement("input"); input != nullptr;
         input = input->NextSiblingElement("input")) {
      const std::size_t at = SIDESTEP_TRY(count(*input, "offset", 0));
      stride = std::max(stride, at + 1);
      if (attribute(*input, "semantic") != "VERTEX") continue;
      corners = input;
      offset = at;
    }
    if (corners == nullptr) return wrong(part, "there is no input VERTEX");
    const auto vertices = SIDESTEP_TRY(points(*corners));
    const auto first = static_cast<int>(mesh_.vertices_m.size());
    for (const Eigen::Vector3d& p : vertices) {
      mesh_.vertices_m.push_back(T * p);
      if (!mesh_.vertices_m.back().allFinite()) return wrong(part, "a vertex is not finite");
    }
    const bool is_mirrored = T.linear().determinant() < 0.0;
    const auto add = [&](int a, int b, int c) {
      if (is_mirrored) std::swap(b, c);
      mesh_.triangles.emplace_back(first + a, first + b, first + c);
    };

    std::vector<std::size_t> sizes;  // of polygons, in corners
    if (const TiXmlElement* const vcount = part.FirstChildElement("vcount")) {
      for (const std::uint32_t size : SIDESTEP_TRY(numbers<std::uint32_t>(*vcount))) {
        sizes.push_back(size);
      }
    }
    if (const TiXmlElement* const hole = part.FirstChildElement("ph")) {
      return wrong(*hole, "polygons with holes are not read");
    }
    std::size_t faces = 0;
    for (const TiXmlElement* p = part.FirstChildElement("p"); p != nullptr;
         p = p->NextSiblingElement("p")) {
      const auto all = SIDESTEP_TRY(numbers<std::uint32_t>(*p));
      std::vector<int> face;
      for (std::size_t i = offset; i < all.size(); i += stride) {
        if (all[i] >= vertices.size()) {
          return wrong(*p, std::to_string(all[i]) + " names no vertex: there are " +
                               std::to_string(vertices.size()));
        }
        face.push_back(static_cast<int>(all[i]));
      }
      if (tag == "triangles") sizes.assign(face.size() / 3, 3);
      if (tag == "polygons") sizes.assign(1, face.size());
      std::size_t at = 0;
      for (const std::size_t size : sizes) {
        if (size < 3 || at + size > face.size()) {
          return wrong(*p, "a face needs at least 3 vertices");
        }
        for (std::size_t i = 2; i < size; ++i) add(face[at], face[at + i - 1], face[at + i]);
        at += size;
        ++faces;
      }
      if (at != face.size() || all.size() % stride != 0) {
        return wrong(*p, "its numbers do not make whole faces");
      }
    }
    if (faces == SIDESTEP_TRY(count(part, "count", faces))) return {};
    return wrong(part, "its count is not that of its faces, " + std::to_string(faces));
  }

  const std::string& file_;
  std::unordered_map<std::string, const TiXmlElement*> elements_;  ///< By their ids.
  std::size_t elements_visited_ = 0, numbers_ = 0;
  Mesh mesh_;
};

}  // namespace

Result<Mesh> read_collada(const std::string& file, const std::string& text) {
  return ColladaReader(file).run(text);
}

}  // namespace sidestep
