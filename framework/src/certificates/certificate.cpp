#include "certificate.hpp"

#include <cmath>
#include <span>
#include <utility>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

Json numbers(const auto& values) {
  Json list = Json::array();
  for (const double one : values) list.push_back(one);
  return list;
}
Json pose_json(const Transform& T) {
  const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows = T.matrix().topRows<3>();
  return numbers(std::span(rows.data(), 12));
}

Json mesh_json(const Mesh& mesh, const Body& body) {
  Json points = Json::array(), triangles = Json::array();
  for (const Eigen::Vector3d& p : mesh.vertices_m) points.push_back(numbers(p));
  for (const Eigen::Vector3i& t : body.triangles()) triangles.push_back({t[0], t[1], t[2]});
  return {{"mesh", {{"points", std::move(points)}, {"triangles", std::move(triangles)}}}};
}

Json shape_json(const Body& body) {
  struct Write {
    const Body& body;
    Json operator()(const Box& box) const { return {{"box", numbers(box.size_m)}}; }
    Json operator()(const Sphere& ball) const { return {{"sphere", ball.radius_m}}; }
    Json operator()(const Cylinder& c) const {
      return {{"cylinder", numbers(std::array{c.radius_m, c.length_m})}};
    }
    Json operator()(const Capsule& c) const {
      return {{"capsule", numbers(std::array{c.radius_m, c.length_m})}};
    }
    Json operator()(const HalfSpace&) const { return {{"half_space", true}}; }
    Json operator()(const std::shared_ptr<const Mesh>& mesh) const {
      return mesh_json(*mesh, body);
    }
  };
  if (body.members().empty()) return std::visit(Write{body}, body.shape());
  Json members = Json::array();
  for (const Swarm::Member& one : body.members()) {
    const Eigen::Vector3d& p = one.centre_m;
    members.push_back({p.x(), p.y(), p.z(), one.size_m});
  }
  return {{body.kind() == Swarm::Kind::kCubes ? "cubes" : "balls", std::move(members)}};
}

Json robot_json(const KinematicTree& robot, const std::vector<Body>& bodies,
                const PolynomialMotion& motion) {
  const RobotDescription& description = robot.description();
  Json joints = Json::array(), links = Json::array(), shapes = Json::array();
  for (const Joint& joint : description.joints) {
    const bool is_bounded = joint.type != Joint::Type::kContinuous;
    const bool has_speed = motion.has_times && std::isfinite(joint.max_velocity);
    joints.push_back({{"name", joint.name},
                      {"lower", is_bounded ? Json(joint.lower) : Json()},
                      {"upper", is_bounded ? Json(joint.upper) : Json()},
                      {"velocity", has_speed ? Json(joint.max_velocity) : Json()}});
  }
  for (std::size_t k = 0; k < description.links.size(); ++k) {
    const TreeJoint& joint = robot.tree_joints()[k];
    static constexpr const char* kMotions[] = {"fixed", "turn", "shift"};
    links.push_back({{"name", description.links[k].name},
                     {"parent", description.links[k].parent},
                     {"pose", pose_json(joint.T_parent_joint)},
                     {"motion", kMotions[static_cast<int>(joint.motion)]},
                     {"axis", numbers(joint.axis)},
                     {"joint", joint.joint},
                     {"multiplier", joint.multiplier},
                     {"offset", joint.offset}});
  }
  for (std::size_t s = 0; s < bodies.size(); ++s) {
    const CollisionShape& shape = description.shapes[s];
    Json one = {{"link", shape.link}, {"pose", pose_json(shape.T_link_shape)}};
    one.update(shape_json(bodies[s]));
    shapes.push_back(std::move(one));
  }
  return {{"name", description.name},
          {"joints", std::move(joints)},
          {"links", std::move(links)},
          {"shapes", std::move(shapes)},
          {"pairs", description.self_collision_pairs}};
}
Json objects_json(const std::vector<CertifiedObject>& objects) {
  Json list = Json::array();
  for (const CertifiedObject& object : objects) {
    Json one = {{"name", object.name}, {"pose", pose_json(object.T_world_body)}};
    one.update(shape_json(object.body));
    if (!object.may_touch.empty()) one["may_touch"] = object.may_touch;
    list.push_back(std::move(one));
  }
  return list;
}
Json motion_json(const PolynomialMotion& motion) {
  Json pieces = Json::array();
  for (const PolynomialPiece& piece : motion.pieces) {
    Json joints = Json::array();
    for (const auto& c : piece.coefficients) joints.push_back(numbers(c));
    pieces.push_back({{"end_s", piece.end_s}, {"joints", std::move(joints)}});
  }
  return pieces;
}

}  // namespace

Json claimed(const KinematicTree& robot, const std::vector<Body>& shapes,
             const std::vector<CertifiedObject>& objects, const PolynomialMotion& motion,
             double margin_m) {
  return {{"format", "sidestep-certificate-3"},
          {"margin_m", margin_m},
          {"robot", robot_json(robot, shapes, motion)},
          {"objects", objects_json(objects)},
          {"motion", motion_json(motion)}};
}

}  // namespace sidestep
