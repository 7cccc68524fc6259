#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>

#include <sidestep/core/file.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/geometry/shape.hpp>

#include "collada.hpp"
#include "mesh_text.hpp"

namespace sidestep {
namespace {

static_assert(std::endian::native == std::endian::little, "binary STL is read as it lies");

constexpr std::uintmax_t kMostMeshBytes = std::uintmax_t{512} << 20;
constexpr std::size_t kStlHeaderBytes = 84;
constexpr std::size_t kStlFacetBytes = 50;

using Words = std::vector<std::string_view>;

std::optional<Eigen::Vector3d> point(const Words& words) {
  if (words.size() < 4) return {};
  Eigen::Vector3d p;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto value = number<double>(words[i + 1]);
    if (!value || !std::isfinite(*value)) return {};
    p[i] = *value;
  }
  return p;
}

/// Calls handle(line number, words) for each line that is not empty; stops at its first error.
template <class Handle>
std::optional<Error> for_each_line(std::string_view text, Handle&& handle) {
  int line_number = 0;
  while (!text.empty()) {
    ++line_number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    const Words words = split(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (words.empty()) continue;
    if (auto error = handle(line_number, words)) return error;
  }
  return {};
}

std::string quoted(std::string_view word) {
  std::string out = "'";
  out += word;
  out += '\'';
  return out;
}

Error line_error(const std::string& file, int line, std::string message) {
  return Error{ErrorCode::kConfig, std::move(message), file + ":" + std::to_string(line), {}, {}};
}

/// STL repeats each vertex for every facet; a closed surface shares them.
class StlBuilder {
 public:
  void add(const std::array<Eigen::Vector3d, 3>& corners) {
    Eigen::Vector3i triangle;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d& p = corners[idx(i)];
      const auto [at, is_new] = known_.try_emplace(std::array<double, 3>{p.x(), p.y(), p.z()},
                                                   static_cast<int>(mesh_.vertices_m.size()));
      if (is_new) mesh_.vertices_m.push_back(p);
      triangle[i] = at->second;
    }
    mesh_.triangles.push_back(triangle);
  }
  Mesh take() { return std::move(mesh_); }

 private:
  std::map<std::array<double, 3>, int> known_;
  Mesh mesh_;
};

Result<Mesh> read_binary_stl(const std::string& file, std::string_view bytes) {
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + kStlHeaderBytes - 4, 4);
  StlBuilder builder;
  for (std::uint32_t i = 0; i < count; ++i) {
    std::array<float, 9> values;  // after the facet's normal, which its corners tell
    std::memcpy(values.data(), bytes.data() + kStlHeaderBytes + i * kStlFacetBytes + 12, 36);
    if (!std::ranges::all_of(values, [](float v) { return std::isfinite(v); })) {
      return fail(ErrorCode::kConfig,
                  "facet " + std::to_string(i) + " has a vertex that is not finite", file);
    }
    std::array<Eigen::Vector3d, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] =
          Eigen::Vector3f(values[3 * k], values[3 * k + 1], values[3 * k + 2]).cast<double>();
    }
    builder.add(corners);
  }
  return builder.take();
}

Result<Mesh> read_text_stl(const std::string& file, std::string_view text) {
  StlBuilder builder;
  std::vector<Eigen::Vector3d> corners;
  bool ended = false;
  const auto handle = [&](int line, const Words& words) -> std::optional<Error> {
    if (words[0] == "vertex") {
      const auto p = point(words);
      if (!p) return line_error(file, line, "expected 'vertex' and three finite numbers");
      corners.push_back(*p);
    } else if (words[0] == "endloop") {
      if (corners.size() != 3) {
        return line_error(file, line,
                          "a facet has " + std::to_string(corners.size()) + " vertices, not 3");
      }
      builder.add({corners[0], corners[1], corners[2]});
      corners.clear();
    } else if (words[0] == "endsolid") {
      ended = true;
    } else if (words[0] != "solid" && words[0] != "facet" && words[0] != "outer" &&
               words[0] != "endfacet") {
      return line_error(file, line, quoted(words[0]) + " is not a keyword of STL");
    }
    return {};
  };
  if (auto error = for_each_line(text, handle)) return tl::make_unexpected(std::move(*error));
  if (!ended) return fail(ErrorCode::kConfig, "the file ends before 'endsolid'", file);
  return builder.take();
}

Result<Mesh> read_stl(const std::string& file, std::string_view bytes) {
  // Binary files may begin with "solid" too; only the size tells the two apart.
  if (bytes.size() >= kStlHeaderBytes) {
    std::uint32_t count = 0;
    std::memcpy(&count, bytes.data() + kStlHeaderBytes - 4, 4);
    const std::size_t expected = kStlHeaderBytes + std::size_t{count} * kStlFacetBytes;
    if (bytes.size() == expected) return read_binary_stl(file, bytes);
    if (!bytes.starts_with("solid")) {
      return fail(ErrorCode::kConfig,
                  "binary STL of " + std::to_string(count) + " facets needs " +
                      std::to_string(expected) + " bytes, the file has " +
                      std::to_string(bytes.size()),
                  file, "the file may be truncated");
    }
  }
  if (!bytes.starts_with("solid")) {
    return fail(ErrorCode::kConfig, "neither a text nor a binary STL file", file);
  }
  return read_text_stl(file, bytes);
}

/// The index of a face's corner such as "7", "7/1", "7//3" or "-1", from 0.
std::optional<int> obj_index(std::string_view word, std::size_t vertex_count) {
  const auto value = number<std::int64_t>(word.substr(0, word.find('/')));
  if (!value) return {};
  const auto count = static_cast<std::int64_t>(vertex_count);
  const std::int64_t index = *value < 0 ? count + *value : *value - 1;
  if (*value == 0 || index < 0 || index >= count) return {};
  return static_cast<int>(index);
}

Result<Mesh> read_obj(const std::string& file, std::string_view text) {
  Mesh mesh;
  const auto handle = [&](int line, const Words& words) -> std::optional<Error> {
    if (words[0] == "v") {
      const auto p = point(words);
      if (!p) return line_error(file, line, "expected 'v' and three finite numbers");
      mesh.vertices_m.push_back(*p);
    } else if (words[0] == "f") {
      std::vector<int> face;
      for (std::size_t i = 1; i < words.size(); ++i) {
        const auto index = obj_index(words[i], mesh.vertices_m.size());
        if (!index) {
          return line_error(file, line,
                            quoted(words[i]) + " names no vertex read so far (" +
                                std::to_string(mesh.vertices_m.size()) + " are)");
        }
        face.push_back(*index);
      }
      if (face.size() < 3) return line_error(file, line, "a face needs at least 3 vertices");
      for (std::size_t i = 2; i < face.size(); ++i) {
        mesh.triangles.emplace_back(face[0], face[i - 1], face[i]);
      }
    }
    return {};  // normals, texture, groups and materials do not shape the surface
  };
  if (auto error = for_each_line(text, handle)) return tl::make_unexpected(std::move(*error));
  return mesh;
}

}  // namespace

Result<Mesh> read_mesh(const std::string& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) {
    return fail(ErrorCode::kNotFound, "there is no such mesh file", file);
  }
  std::string extension = std::filesystem::path(file).extension().string();
  std::ranges::transform(extension, extension.begin(), [](char c) {
    return static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  });
  if (extension != ".stl" && extension != ".obj" && extension != ".dae") {
    return fail(ErrorCode::kConfig, "meshes are read from .stl, .obj and .dae files only", file,
                "convert it, e.g. by `assimp export FILE FILE.stl`");
  }
  const std::string bytes = SIDESTEP_TRY(read_file(file, kMostMeshBytes));
  auto mesh = extension == ".stl"   ? read_stl(file, bytes)
              : extension == ".obj" ? read_obj(file, bytes)
                                    : read_collada(file, bytes);
  if (mesh && mesh->triangles.empty()) {
    return fail(ErrorCode::kConfig, "the mesh has no triangles", file);
  }
  return mesh;
}

}  // namespace sidestep
