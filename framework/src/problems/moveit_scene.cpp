#include "moveit_scene.hpp"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace sidestep {
namespace {

namespace fs = std::filesystem;

// What messages of moveit_msgs, and of what they are made of, can have. Not all of it says anything
// of a problem; what is on no list is a mistake, and would be left out in silence.
const std::vector<std::string> kHeaderKeys{"seq", "stamp", "frame_id"};
const std::vector<std::string> kSceneKeys{"name",
                                          "robot_state",
                                          "robot_model_name",
                                          "fixed_frame_transforms",
                                          "allowed_collision_matrix",
                                          "link_padding",
                                          "link_scale",
                                          "object_colors",
                                          "world",
                                          "is_diff"};
const std::vector<std::string> kObjectKeys{
    "header",          "pose",           "id",         "type",   "primitives",
    "primitive_poses", "meshes",         "mesh_poses", "planes", "plane_poses",
    "subframe_names",  "subframe_poses", "operation"};

std::string lower_case(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

/// Numbers written as [x, y, z] or as {x: ..., y: ..., z: ...}.
Eigen::VectorXd coordinates(const DocumentEntry& entry, const std::vector<const char*>& names) {
  if (!entry.is_map()) return entry.numbers(names.size());
  entry.expect_keys({names.begin(), names.end()});
  Eigen::VectorXd values(static_cast<Eigen::Index>(names.size()));
  for (std::size_t i = 0; i < names.size(); ++i) {
    values[static_cast<Eigen::Index>(i)] = entry[names[i]].number();
  }
  return values;
}

/// A geometry_msgs Pose ("position", "orientation") or Transform ("translation", "rotation").
Transform read_pose(const DocumentEntry& pose, const char* position, const char* orientation) {
  pose.expect_keys({position, orientation});
  Transform T = Transform::Identity();
  T.translation() = coordinates(pose[position], {"x", "y", "z"});
  const Eigen::VectorXd xyzw = coordinates(pose[orientation], {"x", "y", "z", "w"});
  if (!(xyzw.norm() > 0.0)) pose[orientation].complain("this is no orientation");
  T.linear() =
      Eigen::Quaterniond(xyzw[3], xyzw[0], xyzw[1], xyzw[2]).normalized().toRotationMatrix();
  return T;
}
Transform read_pose(const DocumentEntry& pose) {
  return read_pose(pose, "position", "orientation");
}

/// Where the frames of a scene are, seen from the robot's root.
class Frames {
 public:
  Frames(const DocumentEntry& scene, const RobotDescription& robot)
      : root_(robot.links.empty() ? "" : robot.links.front().name) {
    T_planning_frame_ = {{"", Transform::Identity()}};
    if (scene.has("fixed_frame_transforms")) {
      add(scene["fixed_frame_transforms"].items(), robot);
    } else {
      T_planning_frame_["world"] = Transform::Identity();
    }
    T_planning_frame_.emplace(root_, Transform::Identity());
  }

  [[nodiscard]] Transform T_root_frame(const DocumentEntry& object) const {
    if (object.has("header")) object["header"].expect_keys(kHeaderKeys);
    const bool is_named = object.has("header") && object["header"].has("frame_id");
    const std::string frame = is_named ? object["header"]["frame_id"].text() : "";
    const auto found = T_planning_frame_.find(frame);
    if (found != T_planning_frame_.end()) {
      return T_planning_frame_.at(root_).inverse() * found->second;
    }
    object["header"]["frame_id"].complain("'" + frame + "' is neither the robot's root '" + root_ +
                                          "' nor among `fixed_frame_transforms`");
    return Transform::Identity();
  }

 private:
  /// As moveit::core::Transforms writes them, which is not tf's way: `child_frame_id` is the
  /// planning frame, the same in all, and the transform is the pose of `header.frame_id` in it.
  void add(const std::vector<DocumentEntry>& transforms, const RobotDescription& robot) {
    const std::string planning = transforms.front()["child_frame_id"].text();
    T_planning_frame_[planning] = Transform::Identity();
    for (const DocumentEntry& one : transforms) {
      one.expect_keys({"header", "child_frame_id", "transform"});
      one["header"].expect_keys(kHeaderKeys);
      if (one["child_frame_id"].text() != planning) {
        one["child_frame_id"].complain(
            "MoveIt has every frame in its planning frame, the child_frame_id of all, and here '" +
            planning + "' was that before");
      }
      T_planning_frame_[one["header"]["frame_id"].text()] =
          read_pose(one["transform"], "translation", "rotation");
    }
    if (!T_planning_frame_.contains(root_) && robot.link_index(planning)) {
      transforms.front()["child_frame_id"].complain(
          "the planning frame is '" + planning + "', a link of the robot, whose root is '" + root_ +
              "'",
          "MoveIt has the planning frame in child_frame_id, and in header.frame_id what stands in "
          "it");
    }
  }

  std::string root_;
  std::map<std::string, Transform> T_planning_frame_;
};

/// A shape_msgs SolidPrimitive.
Shape read_primitive(const DocumentEntry& primitive) {
  primitive.expect_keys({"type", "dimensions", "polygon"});
  // By name, or by the number of the message's constant.
  const std::string type = lower_case(primitive["type"].text());
  const DocumentEntry dimensions = primitive["dimensions"];
  const auto positive = [&](std::size_t count) {
    Eigen::VectorXd values = dimensions.numbers(count);
    if (!(values.array() > 0.0).all()) dimensions.complain("dimensions must be greater than 0");
    return values;
  };
  if (type == "box" || type == "1") return Box{positive(3)};
  if (type == "sphere" || type == "2") return Sphere{positive(1)[0]};
  if (type == "cylinder" || type == "3") {
    const Eigen::VectorXd height_and_radius = positive(2);
    return Cylinder{height_and_radius[1], height_and_radius[0]};
  }
  primitive["type"].complain("expected box, cylinder or sphere, found '" + type + "'");
  return Sphere{};
}

/// The file that a resource names: a path from the folder of the scene, or "package://NAME/..."
/// below that folder or one that it is in.
std::optional<fs::path> find_resource(const std::string& resource, const fs::path& folder) {
  constexpr std::string_view kPackage = "package://", kFile = "file://";
  std::error_code ignored;
  if (!resource.starts_with(kPackage)) {
    const bool has_scheme = resource.starts_with(kFile);
    const fs::path file = folder / (has_scheme ? resource.substr(kFile.size()) : resource);
    if (fs::is_regular_file(file, ignored)) return file;
    return std::nullopt;
  }
  const std::string rest = resource.substr(kPackage.size());
  for (fs::path base = fs::absolute(folder, ignored);; base = base.parent_path()) {
    if (fs::is_regular_file(base / rest, ignored)) return base / rest;
    if (base == base.parent_path()) return std::nullopt;
  }
}

/// A mesh by its `resource`, stretched by `dimensions` where they are given; or by its `vertices`
/// and `triangles` themselves.
Shape read_mesh_entry(const DocumentEntry& entry, const fs::path& folder) {
  entry.expect_keys({"resource", "dimensions", "vertices", "triangles"});
  Mesh mesh;
  if (entry.has("resource")) {
    for (const char* other : {"vertices", "triangles"}) {
      if (entry.has(other)) entry[other].complain("a mesh has either these or a `resource`");
    }
    const std::string resource = entry["resource"].text();
    const auto file = find_resource(resource, folder);
    if (!file) {
      entry["resource"].complain("there is no file '" + resource + "'",
                                 "packages are looked for in the folders above the scene");
      return std::make_shared<const Mesh>();
    }
    auto read = read_mesh(file->string());
    if (!read) {
      entry["resource"].complain(read.error().describe());
      return std::make_shared<const Mesh>();
    }
    mesh = std::move(*read);
    const Eigen::Vector3d scale = entry.has("dimensions")
                                      ? coordinates(entry["dimensions"], {"x", "y", "z"})
                                      : Eigen::VectorXd::Ones(3);
    for (Eigen::Vector3d& vertex : mesh.vertices_m) vertex = vertex.cwiseProduct(scale);
    return indexed_mesh(std::move(mesh));
  }
  for (const DocumentEntry& vertex : entry["vertices"].items()) {
    mesh.vertices_m.emplace_back(coordinates(vertex, {"x", "y", "z"}));
  }
  const auto count = static_cast<double>(mesh.vertices_m.size());
  for (const DocumentEntry& triangle : entry["triangles"].items()) {
    triangle.expect_keys({"vertex_indices"});
    const DocumentEntry listed = triangle.is_map() ? triangle["vertex_indices"] : triangle;
    const Eigen::VectorXd corners = listed.numbers(3);
    if ((corners.array() < 0.0).any() || (corners.array() >= count).any()) {
      listed.complain("a triangle has a corner that is not among the vertices");
      return std::make_shared<const Mesh>();
    }
    mesh.triangles.emplace_back(corners.cast<int>());
  }
  return indexed_mesh(std::move(mesh));
}

/// A moveit_msgs CollisionObject: one object of ours for each of its shapes. T_root_object: of the
/// frame that it is given in.
void read_object(const DocumentEntry& object, Transform T_root_object, const fs::path& folder,
                 std::vector<SceneObject>& into) {
  object.expect_keys(kObjectKeys);
  if (object.has("planes")) object["planes"].complain("planes are not supported");
  if (object.has("pose")) T_root_object = T_root_object * read_pose(object["pose"]);
  const std::string id = object["id"].text();
  const std::size_t first = into.size();
  for (const auto& [shapes, poses] :
       {std::pair("primitives", "primitive_poses"), {"meshes", "mesh_poses"}}) {
    if (!object.has(shapes)) {
      if (object.has(poses)) {
        object[poses].complain(std::string("there are no `") + shapes + "` for these poses");
      }
      continue;
    }
    const auto listed = object[shapes].items(), places = object[poses].items();
    if (listed.size() != places.size()) {
      object[poses].complain("there are " + std::to_string(listed.size()) + " of `" + shapes +
                             "` and " + std::to_string(places.size()) + " poses");
      return;
    }
    const bool are_meshes = std::string_view(shapes) == "meshes";
    for (std::size_t i = 0; i < listed.size(); ++i) {
      Waypoint place;
      place.T_world_object = T_root_object * read_pose(places[i]);
      SceneObject part;
      part.shape = are_meshes ? read_mesh_entry(listed[i], folder) : read_primitive(listed[i]);
      part.waypoints = {place};
      into.push_back(std::move(part));
    }
  }
  const std::string operation = object.has("operation") ? object["operation"].text() : "0";
  if (operation == "1" || operation == "2" || operation == "3") {
    object["operation"].complain("object '" + id +
                                 "' is removed, appended to or moved here, and "
                                 "only whole objects are read");
  }
  if (into.size() == first) object.complain("object '" + id + "' has no shape");
  for (std::size_t i = first; i < into.size(); ++i) {
    into[i].name = into.size() == first + 1 ? id : id + "/" + std::to_string(i - first);
  }
}

/// A moveit_msgs AttachedCollisionObject.
CarriedObject read_attached(const DocumentEntry& entry, const fs::path& folder) {
  entry.expect_keys({"link_name", "object", "touch_links", "detach_posture", "weight"});
  const DocumentEntry object = entry["object"];
  CarriedObject attached{object["id"].text(), entry["link_name"].text(), {}, {}};
  const std::string frame = object["header"]["frame_id"].text();
  if (!frame.empty() && frame != attached.link) {
    object["header"]["frame_id"].complain("object '" + attached.name + "' is attached to '" +
                                          attached.link + "' and in the frame '" + frame + "'");
  }
  if (entry.has("touch_links")) {
    for (const DocumentEntry& link : entry["touch_links"].items()) {
      attached.touch_links.push_back(link.text());
    }
  }
  std::vector<SceneObject> parts;
  read_object(object, Transform::Identity(), folder, parts);
  for (const SceneObject& part : parts) {
    attached.shapes.push_back({0, part.shape, part.T_world_object(0.0)});
  }
  return attached;
}

/// Complains where joints of several degrees of freedom put the robot anywhere else.
void check_root(const DocumentEntry& state) {
  if (!state.has("multi_dof_joint_state")) return;
  const DocumentEntry joints = state["multi_dof_joint_state"];
  joints.expect_keys({"header", "joint_names", "transforms", "twist", "wrench"});
  if (!joints.has("transforms")) return;
  for (const DocumentEntry& one : joints["transforms"].items()) {
    if (read_pose(one, "translation", "rotation").isApprox(Transform::Identity(), 1e-9)) continue;
    one.complain("the robot's root is not where the planning frame is",
                 "give the scene in the frame of the robot's root");
  }
}

/// Complains about what a scene says and nobody would hear.
void check_whole(const DocumentEntry& scene) {
  scene.expect_keys(kSceneKeys);
  if (scene.has("is_diff") && lower_case(scene["is_diff"].text()) != "false") {
    scene["is_diff"].complain("this is only what changes a scene",
                              "call /get_planning_scene for the whole one");
  }
  for (const char* key : {"link_padding", "link_scale"}) {
    if (!scene.has(key)) continue;
    const double usual = std::string_view(key) == "link_scale" ? 1.0 : 0.0;
    const char* const value = std::string_view(key) == "link_scale" ? "scale" : "padding";
    for (const DocumentEntry& one : scene[key].items()) {
      one.expect_keys({"link_name", value});
      if (one[value].number() == usual) continue;
      one[value].complain("links are taken as they are", "ask for a margin instead");
    }
  }
  if (!scene.has("robot_state")) return;
  check_robot_state(scene["robot_state"]);
}

}  // namespace

void check_robot_state(const DocumentEntry& state) {
  state.expect_keys(
      {"joint_state", "multi_dof_joint_state", "attached_collision_objects", "is_diff"});
  check_root(state);
}

std::vector<SceneObject> read_world(const DocumentEntry& scene, const RobotDescription& robot,
                                    const fs::path& folder) {
  std::vector<SceneObject> objects;
  check_whole(scene);
  const Frames frames(scene, robot);
  if (!scene.has("world")) return objects;
  const DocumentEntry world = scene["world"];
  world.expect_keys({"collision_objects", "octomap"});
  if (world.has("octomap")) {
    world["octomap"].expect_keys({"header", "origin", "octomap"});
    if (world["octomap"].has("octomap")) {
      world["octomap"]["octomap"].expect_keys({"header", "binary", "id", "resolution", "data"});
    }
  }
  if (world.has("octomap") && world["octomap"].has("octomap") &&
      world["octomap"]["octomap"].has("data")) {
    world["octomap"].complain("octomaps are not supported", "certify takes one as a .bt");
  }
  if (!world.has("collision_objects")) return objects;
  for (const DocumentEntry& object : world["collision_objects"].items()) {
    read_object(object, frames.T_root_frame(object), folder, objects);
  }
  return objects;
}

Result<PlanningScene> read_moveit_scene(const Node& message, const fs::path& folder,
                                        const RobotDescription& robot) {
  std::optional<Error> error;
  const DocumentEntry scene(message, error);
  PlanningScene found{Scene(read_world(scene, robot, folder)), {}};
  if (scene.has("robot_state") && scene["robot_state"].has("attached_collision_objects")) {
    for (const DocumentEntry& entry : scene["robot_state"]["attached_collision_objects"].items()) {
      found.attached.push_back(read_attached(entry, folder));
    }
  }
  if (error) return tl::make_unexpected(std::move(*error));
  return found;
}

}  // namespace sidestep
