#include <algorithm>
#include <fstream>
#include <sstream>

#include <sidestep/core/index.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "motion_reader.hpp"

namespace sidestep {
namespace {

/// One message: what `topic echo` prints ends with "---".
Result<Node> read_message(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) return fail(ErrorCode::kIo, "cannot be read", file.string());
  std::string message = text.str();
  while (!message.empty() &&
         std::string_view("-.\n\r ").find(message.back()) != std::string::npos) {
    message.pop_back();
  }
  std::vector<Error> errors;
  auto document = SIDESTEP_TRY(parse_yaml(message, file.string(), errors));
  if (!errors.empty()) return tl::make_unexpected(errors.front());
  return document;
}

tl::unexpected<Error> wrong(const Node& node, const std::string& what) {
  return tl::make_unexpected(node.error(what));
}

Result<const Node*> entry(const Node& node, std::string_view key) {
  if (const Node* const found = node.find(key)) return found;
  return wrong(node, "there is no '" + std::string(key) + "' here");
}

Result<double> number(const Node& node, std::string_view key) {
  return (*SIDESTEP_TRY(entry(node, key))).as_double();
}

bool has_items(const Node& node, std::string_view key) {
  const Node* const list = node.find(key);
  return list != nullptr && !list->items().empty();
}

Result<Eigen::Vector3d> point(const Node& node) {
  const double x = SIDESTEP_TRY(number(node, "x"));
  const double y = SIDESTEP_TRY(number(node, "y"));
  const double z = SIDESTEP_TRY(number(node, "z"));
  return Eigen::Vector3d(x, y, z);
}

Result<Transform> pose(const Node& node) {
  const Node& orientation = *SIDESTEP_TRY(entry(node, "orientation"));
  Transform T = Transform::Identity();
  T.translation() = SIDESTEP_TRY(point(*SIDESTEP_TRY(entry(node, "position"))));
  const Eigen::Vector3d xyz = SIDESTEP_TRY(point(orientation));
  const Eigen::Quaterniond q(SIDESTEP_TRY(number(orientation, "w")), xyz.x(), xyz.y(), xyz.z());
  if (std::abs(q.norm() - 1.0) > 1e-3) return wrong(orientation, "a rotation has not the length 1");
  T.linear() = q.normalized().toRotationMatrix();
  return T;
}

class MoveItMotion {
 public:
  MoveItMotion(const Node& message, const RobotDescription& robot)
      : message_(message), robot_(robot) {}

  [[nodiscard]] Result<MotionSamples> read() {
    const Node* trajectory = &message_;
    if (const Node* const shown = trajectory->find("trajectory"); shown && shown->is_list()) {
      if (shown->items().size() != 1) return wrong(*shown, "one trajectory is wanted");
      trajectory = &shown->items().front();
    }
    if (const Node* const many = trajectory->find("multi_dof_joint_trajectory")) {
      if (has_items(*many, "points"))
        return wrong(*many, "joints of several degrees of freedom are not read");
    }
    if (const Node* const joints = trajectory->find("joint_trajectory")) trajectory = joints;
    SIDESTEP_TRY(read_names(*SIDESTEP_TRY(entry(*trajectory, "joint_names"))));
    const Node& points = *SIDESTEP_TRY(entry(*trajectory, "points"));
    if (points.items().size() < 2) return wrong(points, "a motion has two points at least");
    const Node& first = points.items().front();
    samples_.has_velocities = has_items(first, "velocities");
    samples_.has_accelerations = has_items(first, "accelerations");
    for (const Node& point : points.items()) SIDESTEP_TRY(read_point(point));
    return std::move(samples_);
  }

 private:
  [[nodiscard]] Result<void> read_names(const Node& names) {
    for (const Node& name : names.items()) {
      const auto joint = robot_.joint_index(name.text());
      if (!joint)
        return wrong(name, "robot '" + robot_.name + "' has no joint '" + name.text() + "'");
      if (std::ranges::count(order_, idx(*joint)) > 0)
        return wrong(name, "joint '" + name.text() + "' stands twice");
      order_.push_back(idx(*joint));
    }
    for (std::size_t j = 0; j < robot_.joints.size(); ++j) {
      if (std::ranges::count(order_, j) == 0)
        return wrong(names, "joint '" + robot_.joints[j].name + "' is not among them");
    }
    return {};
  }

  [[nodiscard]] Result<void> read_point(const Node& point) {
    MotionSamples::State state(order_.size());
    const auto read = [&](std::string_view key, std::size_t kind) -> Result<void> {
      const auto values =
          SIDESTEP_TRY((*SIDESTEP_TRY(entry(point, key))).as_doubles(order_.size()));
      for (std::size_t i = 0; i < values.size(); ++i) state[order_[i]][kind] = values[i];
      return {};
    };
    SIDESTEP_TRY(read("positions", 0));
    if (samples_.has_velocities) SIDESTEP_TRY(read("velocities", 1));
    if (samples_.has_accelerations) SIDESTEP_TRY(read("accelerations", 2));
    const Node& time = *SIDESTEP_TRY(entry(point, "time_from_start"));
    const bool is_ros1 = time.find("secs") != nullptr;
    const double time_s = SIDESTEP_TRY(number(time, is_ros1 ? "secs" : "sec")) +
                          1e-9 * SIDESTEP_TRY(number(time, is_ros1 ? "nsecs" : "nanosec"));
    if (!samples_.add(time_s, std::move(state))) return wrong(time, "time does not go on");
    return {};
  }

  const Node& message_;
  const RobotDescription& robot_;
  std::vector<std::size_t> order_;  ///< Of the robot's joints, as the message has them.
  MotionSamples samples_;
};

class MoveItScene {
 public:
  MoveItScene(const Node& message, const KinematicTree& robot) : message_(message), robot_(robot) {}

  [[nodiscard]] Result<Scene> read() {
    const Node& world = *SIDESTEP_TRY(entry(message_, "world"));
    if (const Node* const octomap = world.find("octomap")) {
      const Node* const map = octomap->find("octomap");
      if (map != nullptr && has_items(*map, "data")) return wrong(*map, "an octomap is not read");
    }
    if (const Node* const state = message_.find("robot_state")) {
      if (has_items(*state, "attached_collision_objects"))
        return wrong(*state, "attached objects are not read");
    }
    if (const Node* const objects = world.find("collision_objects")) {
      for (const Node& object : objects->items()) SIDESTEP_TRY(read_object(object));
    }
    return Scene(std::move(objects_));
  }

 private:
  [[nodiscard]] Result<Transform> frame_of(const Node& object) const {
    const Node* const header = object.find("header");
    const Node* const frame = header != nullptr ? header->find("frame_id") : nullptr;
    if (frame == nullptr || frame->text().empty()) return Transform::Identity();
    const RobotDescription& robot = robot_.description();
    const auto link = robot.link_index(frame->text());
    if (!link)
      return wrong(*frame, "robot '" + robot.name + "' has no link '" + frame->text() + "'");
    for (int k = *link; k >= 0; k = robot.links[idx(k)].parent) {
      if (robot_.tree_joints()[idx(k)].joint >= 0) {
        return wrong(*frame, "link '" + frame->text() +
                                 "' moves: the scene is in no frame that stands still");
      }
    }
    std::vector<Transform> links(robot.links.size());
    Scratch scratch;
    robot_.link_poses(std::vector<double>(robot.joints.size()), links, scratch);
    return links[idx(*link)];
  }

  [[nodiscard]] Result<void> read_object(const Node& object) {
    const std::string name = (*SIDESTEP_TRY(entry(object, "id"))).text();
    Transform T = SIDESTEP_TRY(frame_of(object));
    // Of before MoveIt 1.1, objects have none.
    if (const Node* const own = object.find("pose")) T = T * SIDESTEP_TRY(pose(*own));
    if (has_items(object, "planes")) return wrong(object, "a plane is not read");
    const std::size_t before = objects_.size();
    const auto read_all = [&](std::string_view kind, std::string_view poses,
                              auto shape_of) -> Result<void> {
      if (!has_items(object, kind)) return {};
      const Node& shapes = *object.find(kind);
      const Node& places = *SIDESTEP_TRY(entry(object, poses));
      if (shapes.items().size() != places.items().size())
        return wrong(places, "each shape has a pose");
      for (std::size_t i = 0; i < shapes.items().size(); ++i) {
        const Shape shape = SIDESTEP_TRY(shape_of(shapes.items()[i]));
        const Transform T_world_shape = T * SIDESTEP_TRY(pose(places.items()[i]));
        objects_.push_back({name, shape, {{0.0, T_world_shape}}, false, {}, -1});
      }
      return {};
    };
    SIDESTEP_TRY(read_all("primitives", "primitive_poses", primitive));
    SIDESTEP_TRY(read_all("meshes", "mesh_poses", mesh));
    if (objects_.size() == before) return wrong(object, "object '" + name + "' has no shape");
    return {};
  }

  static Result<Shape> primitive(const Node& node) {
    const Node& type = *SIDESTEP_TRY(entry(node, "type"));
    const Node& list = *SIDESTEP_TRY(entry(node, "dimensions"));
    const auto sizes = SIDESTEP_TRY(list.as_doubles());
    if (!std::ranges::all_of(sizes, [](double size) { return size > 0.0 && size < 1e3; })) {
      return wrong(list, "a size is out of bounds");
    }
    // shape_msgs/SolidPrimitive
    if (type.text() == "1" && sizes.size() == 3) return Box{{sizes[0], sizes[1], sizes[2]}};
    if (type.text() == "2" && sizes.size() == 1) return Sphere{sizes[0]};
    if (type.text() == "3" && sizes.size() == 2) return Cylinder{sizes[1], sizes[0]};
    return wrong(type, "neither a box (1), a sphere (2) nor a cylinder (3) with its sizes");
  }

  static Result<Shape> mesh(const Node& node) {
    auto mesh = std::make_shared<Mesh>();
    for (const Node& vertex : (*SIDESTEP_TRY(entry(node, "vertices"))).items()) {
      mesh->vertices_m.push_back(SIDESTEP_TRY(point(vertex)));
    }
    if (mesh->vertices_m.empty()) return wrong(node, "a mesh has no vertices");
    return std::shared_ptr<const Mesh>(std::move(mesh));
  }

  const Node& message_;
  const KinematicTree& robot_;
  std::vector<SceneObject> objects_;
};

}  // namespace

Result<MotionSamples> read_moveit_motion(const std::filesystem::path& file,
                                         const RobotDescription& robot) {
  const auto message = SIDESTEP_TRY(read_message(file));
  return MoveItMotion(message, robot).read();
}

Result<Scene> read_certified_scene(const std::filesystem::path& file, const KinematicTree& robot) {
  const auto message = SIDESTEP_TRY(read_message(file));
  if (message.find("world") != nullptr) return MoveItScene(message, robot).read();
  SceneReading reading = read_scene(message);
  if (!reading.errors.empty()) return tl::make_unexpected(reading.errors.front());
  return std::move(reading.scene);
}

}  // namespace sidestep
