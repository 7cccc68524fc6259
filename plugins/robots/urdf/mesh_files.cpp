#include "mesh_files.hpp"

#include <algorithm>

namespace sidestep::urdf_robot {

std::vector<std::filesystem::path> MeshFinder::candidates(const std::string& uri) const {
  const auto scheme_end = uri.find("://");
  if (scheme_end == std::string::npos) return {urdf_.parent_path() / uri};
  const std::string scheme = uri.substr(0, scheme_end);
  const std::filesystem::path rest = uri.substr(scheme_end + 3);
  if (scheme == "file") return {rest};
  if (scheme != "package" && scheme != "model") return {};

  const std::filesystem::path package = rest.empty() ? rest : *rest.begin();
  const std::filesystem::path inside = rest.lexically_relative(package);
  std::vector<std::filesystem::path> files;
  const auto add = [&](const std::filesystem::path& folder) {
    files.push_back(folder / rest);
    if (folder.filename() == package) files.push_back(folder / inside);
  };
  for (const std::filesystem::path& folder : package_paths_) add(folder);
  std::error_code ignored;
  std::filesystem::path above = std::filesystem::absolute(urdf_, ignored).lexically_normal();
  while (above.has_relative_path()) {
    above = above.parent_path();
    add(above);
  }
  return files;
}

Result<std::shared_ptr<const Mesh>> MeshFinder::load(const std::string& uri,
                                                     const Eigen::Vector3d& scale,
                                                     const SourceMark& mark) const {
  const std::vector<std::filesystem::path> files = candidates(uri);
  std::error_code ignored;
  const auto found = std::ranges::find_if(files, [&](const std::filesystem::path& file) {
    return std::filesystem::is_regular_file(file, ignored);
  });
  if (found == files.end()) {
    std::string tried;
    for (const auto& file : files) tried += (tried.empty() ? "tried " : ", ") + file.string();
    return fail(ErrorCode::kNotFound, "the mesh '" + uri + "' is not there", mark.to_string(),
                "name the folder of its package under 'package_paths'; " + tried);
  }
  auto mesh = SIDESTEP_TRY(read_mesh(found->string()));
  for (Eigen::Vector3d& vertex : mesh.vertices_m) vertex = vertex.cwiseProduct(scale);
  // A mirroring scale turns the triangles inside out.
  if (scale.prod() < 0.0) {
    for (Eigen::Vector3i& triangle : mesh.triangles) std::swap(triangle.y(), triangle.z());
  }
  return indexed_mesh(std::move(mesh));
}

}  // namespace sidestep::urdf_robot
