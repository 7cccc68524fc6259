#include <cmath>
#include <vector>

#include "message_bytes.hpp"
#include "view_messages.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json mesh_json(const Mesh& mesh) {
  Json vertices = Json::array(), triangles = Json::array();
  for (const Eigen::Vector3d& vertex : mesh.vertices_m) vertices.push_back(point_json(vertex));
  for (const Eigen::Vector3i& t : mesh.triangles) {
    triangles.push_back(Json::array({t.x(), t.y(), t.z()}));
  }
  return {{"type", "mesh"}, {"vertices", std::move(vertices)}, {"triangles", std::move(triangles)}};
}

struct ShapeJson {
  Json operator()(const Box& box) const {
    return {{"type", "box"}, {"size_m", point_json(box.size_m)}};
  }
  Json operator()(const Sphere& sphere) const {
    return {{"type", "sphere"}, {"radius_m", sphere.radius_m}};
  }
  Json operator()(const Cylinder& cylinder) const {
    return {{"type", "cylinder"}, {"radius_m", cylinder.radius_m}, {"length_m", cylinder.length_m}};
  }
  Json operator()(const Capsule& capsule) const {
    return {{"type", "capsule"}, {"radius_m", capsule.radius_m}, {"length_m", capsule.length_m}};
  }
  Json operator()(const HalfSpace&) const { return {{"type", "half_space"}}; }
  Json operator()(const std::shared_ptr<const Mesh>& mesh) const { return mesh_json(*mesh); }
};

Json shape_json(const Shape& shape) { return std::visit(ShapeJson{}, shape); }

Json joints_json(const RobotDescription& robot) {
  Json joints = Json::array();
  for (const Joint& joint : robot.joints) {
    joints.push_back({{"name", joint.name},
                      {"unit", joint.unit()},
                      {"lower", finite(joint.lower)},
                      {"upper", finite(joint.upper)},
                      {"max_velocity", finite(joint.max_velocity)}});
  }
  return joints;
}

Json shapes_json(const RobotDescription& robot) {
  Json shapes = Json::array();
  for (const CollisionShape& one : robot.shapes) {
    shapes.push_back({{"link", one.link},
                      {"shape", shape_json(one.shape)},
                      {"pose", pose_json(one.T_link_shape)}});
  }
  return shapes;
}

Json spheres_json(const RobotDescription& robot) {
  Json spheres = Json::array();
  for (const CollisionSphere& sphere : robot.spheres) {
    spheres.push_back({{"link", sphere.link},
                       {"centre_m", point_json(sphere.centre_link_m)},
                       {"radius_m", sphere.radius_m}});
  }
  return spheres;
}

Json objects_json(const Scene* scene) {
  Json objects = Json::array();
  if (scene == nullptr) return objects;
  for (const SceneObject& object : scene->objects()) {
    objects.push_back({{"name", object.name},
                       {"shape", shape_json(object.shape)},
                       {"pose", pose_json(object.T_world_object(0.0))},
                       {"moves", object.moves()}});
  }
  return objects;
}

/// Poses of all links.
Json poses_json(const RobotModel& robot, const Eigen::VectorXd& q) {
  std::vector<Transform> T_world_link(robot.description().links.size());
  Scratch scratch;
  robot.link_poses({q.data(), static_cast<std::size_t>(q.size())}, T_world_link, scratch);
  Json poses = Json::array();
  for (const Transform& pose : T_world_link) poses.push_back(pose_json(pose));
  return poses;
}

}  // namespace

int base_link(const RobotDescription& robot) noexcept {
  int first = static_cast<int>(robot.links.size());
  for (const CollisionSphere& sphere : robot.spheres) first = std::min(first, sphere.link);
  return robot.spheres.empty() ? 0 : first;
}

int tool_link(const RobotDescription& robot) noexcept {
  int last = 0;
  for (const CollisionSphere& sphere : robot.spheres) last = std::max(last, sphere.link);
  return last;
}

ViewMessage world_message(const ObservedWorld& world) {
  const RobotDescription& robot = world.robot->description();
  Json links = Json::array();
  for (const Link& link : robot.links) links.push_back(link.name);
  return make_message(ViewKind::kWorld, Stamp{},
                      {{"title", world.title},
                       {"episode", world.episode},
                       {"robot", robot.name},
                       {"joints", joints_json(robot)},
                       {"links", std::move(links)},
                       {"tool_link", tool_link(robot)},
                       {"shapes", shapes_json(robot)},
                       {"spheres", spheres_json(robot)},
                       {"objects", objects_json(world.scene.get())},
                       {"start", poses_json(*world.robot, world.q_start)},
                       {"goal", poses_json(*world.robot, world.q_goal)}});
}

ViewMessage recorded_world(const ViewMessage& world) {
  const std::string& bytes = *world.bytes;
  std::uint32_t length = 0;
  if (bytes.size() < sizeof(length)) return world;
  std::memcpy(&length, bytes.data(), sizeof(length));
  Json header = Json::parse(bytes.substr(sizeof(length), length), nullptr, false);
  if (!header.is_object()) return world;
  header["recorded"] = true;
  return make_message(ViewKind::kWorld, world.stamp, std::move(header));
}

}  // namespace sidestep
