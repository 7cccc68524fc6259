#include <sidestep/geometry/shape.hpp>

#include "fuzzing.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// The same bytes as a file of each kind.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  for (const char* name : {"mesh.stl", "mesh.obj", "mesh.dae"}) {
    const auto file = folder.write(name, text_of(data, size));
    const auto mesh = read_mesh(file.string());
    if (!is_read(mesh, file.string())) continue;
    for (const Eigen::Vector3d& p : mesh->vertices_m) {
      require(p.allFinite(), "a vertex is finite");
    }
    const int count = static_cast<int>(mesh->vertices_m.size());
    for (const Eigen::Vector3i& triangle : mesh->triangles) {
      require(triangle.minCoeff() >= 0 && triangle.maxCoeff() < count, "a corner is a vertex");
    }
  }
  return 0;
}
