#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>

#include <fstream>

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

Result<Swarm> read_octomap(const fs::path& file) {
  const auto none = [&] {
    return fail(ErrorCode::kConfig, "is no OctoMap that can be read", file.string());
  };
  std::ifstream in(file, std::ios::binary);
  if (!in) return fail(ErrorCode::kIo, "cannot be read", file.string());
  if (file.extension() == ".bt") {
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
