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
#include <numbers>
#include <string>
#include <vector>

#include <sidestep/core/format.hpp>

#include "shapes.hpp"

namespace sidestep::scene_meshes {
namespace {

namespace fs = std::filesystem;

constexpr double kDuration_s = 142.0;
constexpr double kSpacing_s = 0.5;
constexpr double kRounds = 3.0;

/// The sway of a hand: a few waves whose periods have nothing in common.
double sway(double time_s, double phase) {
  return 0.5 * std::sin(2.0 * std::numbers::pi * time_s / 3.7 + phase) +
         0.3 * std::sin(2.0 * std::numbers::pi * time_s / 1.9 + 2.3 * phase) +
         0.2 * std::sin(2.0 * std::numbers::pi * time_s / 1.3 + 4.1 * phase);
}

/// Where the camera is: around the middle of the room, higher and lower, nearer and farther.
Eigen::Vector3d position_m(double time_s) {
  const double angle = -2.2 + 2.0 * std::numbers::pi * kRounds * time_s / kDuration_s;
  const double reach = 1.0 - 0.06 * (1.0 + std::sin(2.0 * std::numbers::pi * time_s / 31.0));
  return {
      2.2 * reach * std::cos(angle) + 0.02 * sway(time_s, 0.0),
      1.8 * reach * std::sin(angle) + 0.02 * sway(time_s, 1.0),
      1.25 + 0.35 * std::sin(2.0 * std::numbers::pi * time_s / 23.0) + 0.015 * sway(time_s, 2.0)};
}

/// A point 1.5 m ahead: mostly towards the middle, swinging to both sides, up and down.
Eigen::Vector3d look_at_m(double time_s) {
  const Eigen::Vector3d from = position_m(time_s);
  const double inwards = std::atan2(-from.y(), -from.x());
  const double yaw =
      inwards + 0.75 * std::sin(2.0 * std::numbers::pi * time_s / 17.0) + 0.04 * sway(time_s, 3.0);
  const double pitch = -0.22 + 0.22 * std::sin(2.0 * std::numbers::pi * time_s / 11.0) -
                       0.25 * (from.z() - 1.25) + 0.03 * sway(time_s, 4.0);
  return from + 1.5 * Eigen::Vector3d(std::cos(pitch) * std::cos(yaw),
                                      std::cos(pitch) * std::sin(yaw), std::sin(pitch));
}

/// The YAML of a camera path as a hand would carry it around the room, one waypoint a line.
std::string handheld_path() {
  std::string text;
  for (int i = 0; i * kSpacing_s <= kDuration_s; ++i) {
    const double time_s = i * kSpacing_s;
    const Eigen::Vector3d p = position_m(time_s), at = look_at_m(time_s);
    text += format(
        "    - {time_s: %.1f, position_m: [%.3f, %.3f, %.3f], look_at_m: [%.3f, %.3f, %.3f]}\n",
        time_s, p.x(), p.y(), p.z(), at.x(), at.y(), at.z());
  }
  return text;
}

/// As an OBJ file, millimetres rounded; `title` goes into its first line.
std::string to_obj(const Triangles& mesh, const std::string& title) {
  std::string text = "# " + title + "\n# Written by tools/scene_meshes.\n";
  for (const Eigen::Vector3d& v : mesh.vertices_m) {
    // Rounded here, so that no -0.000 depends on the last bit.
    const auto mm = [](double value_m) { return static_cast<int>(std::lround(1e3 * value_m)); };
    text += format("v %g %g %g\n", 1e-3 * mm(v.x()), 1e-3 * mm(v.y()), 1e-3 * mm(v.z()));
  }
  for (const Eigen::Vector3i& f : mesh.faces) {
    text += format("f %d %d %d\n", f.x() + 1, f.y() + 1, f.z() + 1);
  }
  return text;
}

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
