#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>

#include <bit>
#include <optional>
#include <sstream>
#include <string_view>

#include <sidestep/core/file.hpp>
#include <sidestep/core/format.hpp>

#include "motion_reader.hpp"
#include "pcd_file.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;

/// The occupied leaves, whatever else a node holds.
template <class Tree>
Swarm cubes_of(const Tree& tree, const fs::path& file) {
  Swarm swarm{file.filename().string(), Swarm::Kind::kCubes, {}};
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (!tree.isNodeOccupied(*leaf)) continue;
    swarm.members.push_back(
        {Eigen::Vector3d(leaf.getX(), leaf.getY(), leaf.getZ()), leaf.getSize()});
  }
  return swarm;
}

constexpr std::uintmax_t kMostMapBytes = std::uintmax_t{1} << 30;

/// What OctoMap is to read. Its readers go on where a file ends, as deep as it says, without
/// looking.
struct OctoMapFile {
  std::string type;
  std::size_t nodes = 0;
  double resolution_m = 0.0;
  std::string_view data;
};

std::optional<OctoMapFile> octomap_header(std::string_view bytes, std::string_view first_line) {
  constexpr std::string_view kEnd = "\ndata\n";
  const std::size_t end = bytes.find(kEnd);
  if (!bytes.starts_with(first_line) || end == std::string_view::npos) return {};
  OctoMapFile file;
  file.data = bytes.substr(end + kEnd.size());
  std::istringstream lines(std::string(bytes.substr(0, end)));
  for (std::string line, key; std::getline(lines, line);) {
    std::istringstream words(line);
    words >> key;
    if (key == "id") words >> file.type;
    if (key == "size") words >> file.nodes;
    if (key == "res") words >> file.resolution_m;
  }
  if (!(file.resolution_m >= 1e-6 && file.resolution_m <= 1e6)) return {};
  return file;
}

/// How many nodes follow one: of its eight bits, or of eight pairs those that are 11.
int children_of(std::string_view record, bool is_binary) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(record[i]); };
  if (!is_binary) return std::popcount(byte(record.size() - 1));
  const unsigned pairs = byte(0) | byte(1) << 8U;
  return std::popcount(pairs & pairs >> 1U & 0x5555U);
}

/// Whether a tree's nodes are all there, none deeper than OctoMap's are.
bool is_tree(const OctoMapFile& file, bool is_binary) {
  constexpr std::size_t kDeepest = 16;
  const std::size_t bytes = is_binary ? 2 : file.type == "ColorOcTree" ? 8 : 5;
  std::string_view data = file.data;
  std::vector<int> yet{file.nodes > 0 ? 1 : 0};  // to come, of each depth
  while (!yet.empty()) {
    if (yet.back()-- == 0) {
      yet.pop_back();
      continue;
    }
    if (data.size() < bytes) return false;
    const int children = children_of(data.substr(0, bytes), is_binary);
    data.remove_prefix(bytes);
    if (children == 0) continue;
    if (yet.size() > kDeepest) return false;
    yet.push_back(children);
  }
  return true;
}

Result<Swarm> read_octomap(const fs::path& file) {
  const auto none = [&] {
    return fail(ErrorCode::kConfig, "is no OctoMap that can be read", file.string());
  };
  const std::string bytes = SIDESTEP_TRY(read_file(file, kMostMapBytes));
  const bool is_binary = file.extension() == ".bt";
  const auto header =
      octomap_header(bytes, is_binary ? "# Octomap OcTree binary file" : "# Octomap OcTree file");
  const bool is_known = header && (header->type == "OcTree" || header->type == "ColorOcTree");
  if (!is_known || !is_tree(*header, is_binary)) return none();
  std::istringstream in(bytes);
  if (is_binary) {
    octomap::OcTree tree(0.1);
    if (!tree.readBinary(in)) return none();
    return cubes_of(tree, file);
  }
  const std::unique_ptr<octomap::AbstractOcTree> read(octomap::AbstractOcTree::read(in));
  if (const auto* const tree = dynamic_cast<const octomap::OcTree*>(read.get())) {
    return cubes_of(*tree, file);
  }
  if (const auto* const tree = dynamic_cast<const octomap::ColorOcTree*>(read.get())) {
    return cubes_of(*tree, file);
  }
  return none();
}

Result<Swarm> read_cloud(const fs::path& file, std::optional<double> point_radius_m) {
  if (!point_radius_m) {
    return fail(ErrorCode::kConfig, "points have no extent: say how large they are to be taken",
                file.string(), "--point_radius_m 0.02");
  }
  auto cloud = pcd::read_pcd(file);
  if (!cloud)
    return tl::make_unexpected(
        cloud.error().wrapped(ErrorCode::kConfig, "no scene", file.string()));
  Swarm swarm{file.filename().string(), Swarm::Kind::kBalls, {}};
  for (const Eigen::Vector3f& p : cloud->points_m) {
    swarm.members.push_back({p.cast<double>(), *point_radius_m});
  }
  return swarm;
}

Result<SceneInput> of_swarm(Result<Swarm> swarm, const fs::path& file) {
  if (!swarm) return tl::make_unexpected(std::move(swarm.error()));
  if (swarm->members.empty()) {
    return fail(ErrorCode::kConfig, "nothing is occupied in it", file.string());
  }
  return SceneInput{{{}, {std::move(*swarm)}}, {}};
}

/// FAMILY.json#INDEX of a problem set.
Result<SceneInput> read_problem_scene(const std::string& name, const RobotDescription& robot) {
  const auto hash = name.rfind('#');
  for (const SetProblem& problem : SIDESTEP_TRY(read_problem_set(name.substr(0, hash), robot))) {
    if (std::to_string(problem.index) != name.substr(hash + 1)) continue;
    return SceneInput{{*problem.scene, {}}, {}};
  }
  return fail(ErrorCode::kConfig, "there is no problem of this number", name);
}

}  // namespace

Result<SceneInput> read_certified_scene(const fs::path& file, const RobotDescription& robot,
                                        std::optional<double> point_radius_m) {
  const std::string kind = file.extension().string();
  if (kind == ".bt" || kind == ".ot") return of_swarm(read_octomap(file), file);
  if (kind == ".pcd") return of_swarm(read_cloud(file, point_radius_m), file);
  if (kind == ".bag") return of_swarm(read_recorded_map(file), file);
  if (kind.starts_with(".json#")) return read_problem_scene(file.string(), robot);
  if (kind != ".yaml" && kind != ".yml" && kind != ".json") {
    return fail(ErrorCode::kConfig, "a scene is .yaml, .bt, .ot, .pcd, .bag, or FAMILY.json#NUMBER",
                file.string());
  }
  const auto document = SIDESTEP_TRY(read_message(file));
  const Node* const answer = document.find("scene");  // of the service /get_planning_scene
  const Node& message = answer != nullptr ? *answer : document;
  if (message.find("world") != nullptr) {
    auto scene = SIDESTEP_TRY(read_moveit_scene(message, file.parent_path(), robot));
    return SceneInput{{std::move(scene.world), {}}, std::move(scene.attached)};
  }
  SceneReading reading = read_scene(message);
  if (!reading.errors.empty()) return tl::make_unexpected(reading.errors.front());
  const auto stands = [](const SceneObject& object) { return !object.moves() && !object.random; };
  if (message.find("people") != nullptr || !std::ranges::all_of(reading.scene.objects(), stands)) {
    return fail(ErrorCode::kConfig, "people and objects that move, or are drawn, are not certified",
                file.string());
  }
  return SceneInput{{std::move(reading.scene), {}}, {}};
}

}  // namespace sidestep
