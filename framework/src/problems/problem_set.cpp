#include <sidestep/problems/problem_set.hpp>

#include <algorithm>
#include <utility>

#include "document_entry.hpp"

namespace sidestep {
namespace {

constexpr int kLargestIndex = 1'000'000;

Shape read_shape(const JsonEntry& obstacle) {
  const std::string type = obstacle["type"].text();
  std::vector<std::string> keys{"name", "type", "position", "quaternion_xyzw"};
  const auto has = [&](std::initializer_list<const char*> sizes) {
    keys.insert(keys.end(), sizes.begin(), sizes.end());
    obstacle.expect_keys(keys);
  };
  if (type == "cylinder") {
    has({"radius", "height"});
    return Cylinder{obstacle["radius"].positive(), obstacle["height"].positive()};
  }
  if (type == "sphere") {
    has({"radius"});
    return Sphere{obstacle["radius"].positive()};
  }
  if (type != "box")
    obstacle["type"].complain("expected box, cylinder or sphere, found '" + type + "'");
  has({"size"});
  const Eigen::Vector3d size_m = obstacle["size"].vector3();
  if (!(size_m.array() > 0.0).all()) obstacle["size"].complain("edges must be longer than 0");
  return Box{size_m};
}

SceneObject read_obstacle(const JsonEntry& obstacle) {
  const Eigen::VectorXd xyzw = obstacle["quaternion_xyzw"].numbers(4);
  if (!(xyzw.norm() > 0.0)) obstacle["quaternion_xyzw"].complain("this is no orientation");
  Waypoint place;
  place.T_world_object.translation() = obstacle["position"].vector3();
  place.T_world_object.linear() =
      Eigen::Quaterniond(xyzw[3], xyzw[0], xyzw[1], xyzw[2]).normalized().toRotationMatrix();
  SceneObject object;
  object.name = obstacle["name"].text();
  object.shape = read_shape(obstacle);
  object.waypoints = {place};
  return object;
}

/// Where in the file's configurations each of the robot's joints stands.
std::vector<std::size_t> places_of_joints(const JsonEntry& names, const RobotDescription& robot) {
  std::vector<std::string> listed;
  for (const JsonEntry& name : names.items()) {
    listed.push_back(name.text());
    if (std::ranges::count(listed, listed.back()) > 1) {
      name.complain("joint '" + listed.back() + "' stands here twice");
    }
  }
  std::vector<std::size_t> places;
  for (const Joint& joint : robot.joints) {
    const auto at = std::ranges::find(listed, joint.name);
    if (at == listed.end()) {
      names.complain("robot '" + robot.name + "' moves joint '" + joint.name +
                     "', which is not here");
      return {};
    }
    places.push_back(static_cast<std::size_t>(at - listed.begin()));
  }
  return places;
}

Eigen::VectorXd read_configuration(const JsonEntry& values, std::size_t count,
                                   const std::vector<std::size_t>& places) {
  const Eigen::VectorXd listed = values.numbers(count);
  Eigen::VectorXd q(static_cast<Eigen::Index>(places.size()));
  for (std::size_t j = 0; j < places.size(); ++j) {
    q[static_cast<Eigen::Index>(j)] = listed[static_cast<Eigen::Index>(places[j])];
  }
  return q;
}

/// Where a set says what its numbers are, they are these.
void check_units(const JsonEntry& set) {
  if (!set.has("units")) return;
  set["units"].expect_keys({"length", "angle"});
  for (const auto& [quantity, unit] : {std::pair("length", "m"), std::pair("angle", "rad")}) {
    if (!set["units"].has(quantity)) continue;
    const JsonEntry told = set["units"][quantity];
    if (told.text() != unit) told.complain(std::string("only '") + unit + "' is supported");
  }
}

Result<std::vector<SetProblem>> read_family(const std::filesystem::path& file,
                                            const RobotDescription& robot) {
  std::vector<SetProblem> problems;
  auto content = SIDESTEP_TRY(JsonEntry::read(file.string()));
  const JsonEntry set(content);
  constexpr std::string_view kFormat = "mbm-neutral/1";
  if (set["format"].text() != kFormat) {
    set["format"].complain("expected '" + std::string(kFormat) + "'");
  }
  set.expect_keys({"format", "robot", "family", "units", "frame", "conventions", "source",
                   "joint_names", "problems"});
  check_units(set);
  const std::string family = set["family"].text();
  const JsonEntry names = set["joint_names"];
  const std::vector<std::size_t> places = places_of_joints(names, robot);
  for (const JsonEntry& problem : set["problems"].items()) {
    if (content.error) break;
    problem.expect_keys({"index", "start", "goals", "other_joints", "obstacles"});
    SetProblem read;
    read.family = family;
    read.index = problem["index"].integer(0, kLargestIndex);
    read.q_start = read_configuration(problem["start"], names.size(), places);
    const JsonEntry goals = problem["goals"];
    if (goals.size() != 1) goals.complain("only problems with one goal are supported");
    read.q_goal = read_configuration(goals.at(0), names.size(), places);
    std::vector<SceneObject> objects;
    for (const JsonEntry& obstacle : problem["obstacles"].items()) {
      objects.push_back(read_obstacle(obstacle));
    }
    read.scene = std::make_shared<const Scene>(std::move(objects));
    problems.push_back(std::move(read));
  }
  if (content.error) return tl::make_unexpected(*content.error);
  return problems;
}

/// What a folder holds, in order of names: files of the neutral form, folders of
/// MotionBenchMaker's.
std::vector<std::filesystem::path> families_in(const std::filesystem::path& folder) {
  if (holds_moveit_problems(folder)) return {folder};
  std::vector<std::filesystem::path> found;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    const bool is_family = entry.is_directory(ignored) ? holds_moveit_problems(entry.path())
                                                       : entry.path().extension() == ".json";
    if (is_family) found.push_back(entry.path());
  }
  std::ranges::sort(found);
  return found;
}

}  // namespace

Result<std::vector<SetProblem>> read_problem_set(const std::filesystem::path& from,
                                                 const RobotDescription& robot) {
  std::vector<std::filesystem::path> families{from};
  std::error_code ignored;
  if (std::filesystem::is_directory(from, ignored)) {
    families = families_in(from);
    if (families.empty()) {
      return fail(ErrorCode::kNotFound,
                  "there are no problems in this folder, neither *.json nor request*.yaml",
                  from.string());
    }
  }
  std::vector<SetProblem> problems;
  for (const std::filesystem::path& family : families) {
    auto read = SIDESTEP_TRY(std::filesystem::is_directory(family, ignored)
                                 ? read_moveit_family(family, robot)
                                 : read_family(family, robot));
    std::ranges::move(read, std::back_inserter(problems));
  }
  return problems;
}

}  // namespace sidestep
