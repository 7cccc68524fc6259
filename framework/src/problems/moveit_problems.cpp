#include <sidestep/problems/problem_set.hpp>

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include <sidestep/runtime/yaml_document.hpp>

#include "document_entry.hpp"
#include "moveit_scene.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;

/// Joint positions by name.
using Positions = std::map<std::string, double>;

constexpr const char* kRequest = "request";
constexpr const char* kScene = "scene";

constexpr std::size_t kMostDigits = 9;  // an int holds them

/// The digits before ".yaml" in a name that begins with `prefix`; empty for other names.
std::string digits_of(const fs::path& file, std::string_view prefix) {
  const std::string stem = file.stem().string();
  const bool is_yaml = file.extension() == ".yaml" || file.extension() == ".yml";
  if (!is_yaml || !stem.starts_with(prefix)) return "";
  return stem.substr(stem.find_last_not_of("0123456789") + 1);
}

/// The files of a folder that begin with `prefix`, by their digits; of several with the same, the
/// one with nothing between the two comes first, then the first by name.
std::map<std::string, std::vector<fs::path>> numbered_files(const fs::path& folder,
                                                            std::string_view prefix) {
  std::map<std::string, std::vector<fs::path>> files;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string digits = digits_of(entry.path(), prefix);
    if (!digits.empty()) files[digits].push_back(entry.path());
  }
  for (auto& [digits, alike] : files) {
    const std::string plain = std::string(prefix) + digits;
    std::ranges::sort(alike, {},
                      [&](const fs::path& file) { return std::pair(file.stem() != plain, file); });
  }
  return files;
}

// What these messages can have; not all of it says anything of a problem.
const std::vector<std::string> kRequestKeys{"workspace_parameters",
                                            "start_state",
                                            "goal_constraints",
                                            "path_constraints",
                                            "trajectory_constraints",
                                            "reference_trajectories",
                                            "pipeline_id",
                                            "planner_id",
                                            "group_name",
                                            "num_planning_attempts",
                                            "allowed_planning_time",
                                            "max_velocity_scaling_factor",
                                            "max_acceleration_scaling_factor",
                                            "cartesian_speed_end_effector_link",
                                            "cartesian_speed_limited_link",
                                            "max_cartesian_speed"};
const std::vector<std::string> kConstraintKeys{"name", "joint_constraints", "position_constraints",
                                               "orientation_constraints", "visibility_constraints"};

/// A sensor_msgs JointState: what it says comes before what was said.
void read_joint_state(const DocumentEntry& state, Positions& positions) {
  state.expect_keys({"header", "name", "position", "velocity", "effort"});
  const auto names = state["name"].items(), values = state["position"].items();
  if (names.size() != values.size()) {
    state["position"].complain("there are " + std::to_string(names.size()) + " names and " +
                               std::to_string(values.size()) + " positions");
    return;
  }
  std::set<std::string> told;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string name = names[i].text();
    if (!told.insert(name).second) names[i].complain("joint '" + name + "' stands here twice");
    positions[name] = values[i].number();
  }
  if (!state.has("velocity")) return;
  for (const DocumentEntry& velocity : state["velocity"].items()) {
    if (velocity.number() != 0.0) velocity.complain("only motions from rest are supported");
  }
}

/// A moveit_msgs RobotState, which may leave out what it does not change.
void read_robot_state(const DocumentEntry& parent, const char* key, Positions& positions) {
  if (!parent.has(key)) return;
  const DocumentEntry state = parent[key];
  check_robot_state(state);
  if (state.has("attached_collision_objects")) {
    state["attached_collision_objects"].complain("attached objects are not supported");
  }
  if (state.has("joint_state")) read_joint_state(state["joint_state"], positions);
}

Positions read_goal(const DocumentEntry& request) {
  Positions goal;
  const DocumentEntry listed = request["goal_constraints"];
  const auto constraints = listed.items();
  if (constraints.size() != 1) {
    listed.complain("only problems with one goal are supported, and there are " +
                    std::to_string(constraints.size()));
    return goal;
  }
  constraints.front().expect_keys(kConstraintKeys);
  for (const char* other :
       {"position_constraints", "orientation_constraints", "visibility_constraints"}) {
    if (!constraints.front().has(other)) continue;
    constraints.front()[other].complain("only goals that are positions of joints are supported");
  }
  for (const DocumentEntry& joint : constraints.front()["joint_constraints"].items()) {
    joint.expect_keys({"joint_name", "position", "tolerance_above", "tolerance_below", "weight"});
    const std::string name = joint["joint_name"].text();
    if (!goal.emplace(name, joint["position"].number()).second) {
      joint["joint_name"].complain("joint '" + name + "' stands here twice");
    }
  }
  return goal;
}

/// Complains about what a motion would have to keep to on its way.
void check_free_way(const DocumentEntry& request) {
  std::vector<DocumentEntry> all;
  if (request.has("path_constraints")) all.push_back(request["path_constraints"]);
  if (request.has("trajectory_constraints")) {
    const DocumentEntry way = request["trajectory_constraints"];
    way.expect_keys({"constraints"});
    if (way.has("constraints"))
      std::ranges::copy(way["constraints"].items(), std::back_inserter(all));
  }
  for (const DocumentEntry& constraints : all) {
    constraints.expect_keys(kConstraintKeys);
    for (const std::string& key : kConstraintKeys) {
      if (key == "name" || !constraints.has(key.c_str())) continue;
      constraints[key.c_str()].complain("constraints on the way are not supported");
    }
  }
}

/// The robot's own joints, of all that are named; complains where one is not.
Eigen::VectorXd configuration_of(const Positions& positions, const RobotDescription& robot,
                                 const DocumentEntry& from) {
  Eigen::VectorXd q = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(robot.joints.size()));
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const auto found = positions.find(robot.joints[j].name);
    if (found == positions.end()) {
      from.complain("robot '" + robot.name + "' moves joint '" + robot.joints[j].name +
                    "', which is not here");
      return q;
    }
    q[static_cast<Eigen::Index>(j)] = found->second;
  }
  return q;
}

Result<SetProblem> read_problem(const fs::path& scene_file, const fs::path& request_file,
                                const RobotDescription& robot) {
  const YamlDocumentReader reader;
  const auto scene_document = SIDESTEP_TRY(reader.read(scene_file));
  const auto request_document = SIDESTEP_TRY(reader.read(request_file));
  std::optional<Error> error;
  const DocumentEntry scene(scene_document, error), request(request_document, error);
  request.expect_keys(kRequestKeys);
  check_free_way(request);
  SetProblem problem;
  problem.scene = std::make_shared<const Scene>(read_world(scene, robot, scene_file.parent_path()));
  Positions start;
  read_robot_state(scene, "robot_state", start);
  read_robot_state(request, "start_state", start);
  problem.q_start = configuration_of(start, robot, request["start_state"]);
  problem.q_goal = configuration_of(read_goal(request), robot, request["goal_constraints"]);
  if (error) return tl::make_unexpected(std::move(*error));
  return problem;
}

}  // namespace

bool holds_moveit_problems(const fs::path& folder) {
  return !numbered_files(folder, kRequest).empty();
}

Result<std::vector<SetProblem>> read_moveit_family(const fs::path& folder,
                                                   const RobotDescription& robot) {
  std::string family = fs::absolute(folder).lexically_normal().filename().string();
  if (family.empty()) family = fs::absolute(folder).lexically_normal().parent_path().filename();
  if (family.ends_with("_" + robot.name)) family.resize(family.size() - robot.name.size() - 1);
  const auto scenes = numbered_files(folder, kScene), requests = numbered_files(folder, kRequest);
  for (const auto& [digits, files] : scenes) {
    if (requests.contains(digits)) continue;
    return fail(ErrorCode::kNotFound, "there is no request" + digits + ".yaml beside the scene",
                files.front().string());
  }
  std::vector<SetProblem> problems;
  for (const auto& [digits, files] : requests) {
    const fs::path& request = files.front();
    const auto scene = scenes.find(digits);
    if (scene == scenes.end()) {
      return fail(ErrorCode::kNotFound, "there is no scene" + digits + ".yaml beside the request",
                  request.string());
    }
    if (files.size() > 1) {
      return fail(ErrorCode::kConfig, "there is another request of this number beside it",
                  files.back().string());
    }
    if (digits.size() > kMostDigits) {
      return fail(ErrorCode::kConfig,
                  "the number has more than " + std::to_string(kMostDigits) + " digits",
                  request.string());
    }
    auto problem = SIDESTEP_TRY(read_problem(scene->second.front(), request, robot));
    problem.family = family;
    problem.index = std::stoi(digits);
    problems.push_back(std::move(problem));
  }
  std::ranges::stable_sort(problems, {}, &SetProblem::index);
  return problems;
}

}  // namespace sidestep
