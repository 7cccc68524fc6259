// Writes the meshes and the camera path of the room with the cow and the lady: organic, curved and
// thin shapes for measuring maps. What it writes is part of the tree; a test compares.
//
//   scene_meshes CONFIGS [--check]

#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "triangles.hpp"

namespace sidestep::scene_meshes {

std::string to_obj(const Triangles& mesh, const std::string& title) {
  std::string text = "# " + title + "\n# Written by tools/scene_meshes.\n";
  char line[96];
  for (const Eigen::Vector3d& v : mesh.vertices_m) {
    // Rounded here, so that no -0.000 depends on the last bit.
    const auto mm = [](double value_m) { return static_cast<int>(std::lround(1e3 * value_m)); };
    std::snprintf(line, sizeof line, "v %g %g %g\n", 1e-3 * mm(v.x()), 1e-3 * mm(v.y()),
                  1e-3 * mm(v.z()));
    text += line;
  }
  for (const Eigen::Vector3i& f : mesh.faces) {
    std::snprintf(line, sizeof line, "f %d %d %d\n", f.x() + 1, f.y() + 1, f.z() + 1);
    text += line;
  }
  return text;
}

namespace {

namespace fs = std::filesystem;

struct File {
  fs::path path;
  std::string text;
};

std::vector<File> files() {
  const fs::path meshes = "scenes/meshes";
  return {{meshes / "cow.obj", to_obj(cow(), "A cow of 2 m, facing x.")},
          {meshes / "lady.obj", to_obj(lady(), "A lady of 1.7 m in a long dress, facing x.")},
          {meshes / "armchair.obj", to_obj(armchair(), "A round armchair, facing x.")},
          {meshes / "vase.obj", to_obj(vase(), "A vase, 0.45 m high.")},
          {meshes / "leaves.obj", to_obj(leaves(), "Nine bent leaves, 8 mm thick.")},
          {meshes / "curtain.obj", to_obj(curtain(), "A curtain in folds, 1 cm thick, along x.")},
          {"parts/handheld_path.yaml",
           "# 142 s around the middle of a room as a hand would carry the camera.\n"
           "# Written by tools/scene_meshes.\n"
           "source:\n  camera_path:\n" +
               handheld_path()}};
}

bool is_same(const fs::path& path, const std::string& text) {
  std::ifstream in(path, std::ios::binary);
  return std::string{std::istreambuf_iterator<char>(in), {}} == text;
}

int run(const fs::path& configs, bool check) {
  int differing = 0;
  for (const File& file : files()) {
    const fs::path path = configs / file.path;
    if (check) {
      if (is_same(path, file.text)) continue;
      std::fprintf(stderr, "%s is not what scene_meshes writes\n", path.c_str());
      ++differing;
      continue;
    }
    std::ofstream out(path, std::ios::binary);
    out << file.text;
    out.close();
    if (!out) {
      std::fprintf(stderr, "cannot write %s\n", path.c_str());
      return 4;
    }
  }
  return differing == 0 ? 0 : 1;
}

}  // namespace
}  // namespace sidestep::scene_meshes

int main(int argc, char** argv) {
  const bool check = argc == 3 && std::strcmp(argv[2], "--check") == 0;
  if (argc != 2 && !check) {
    std::fprintf(stderr, "usage: scene_meshes CONFIGS [--check]\n");
    return 2;
  }
  return sidestep::scene_meshes::run(argv[1], check);
}
