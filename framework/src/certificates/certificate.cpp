#include "certificate.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <span>

#include <nlohmann/json.hpp>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

std::string number(auto x) {
  std::array<char, 32> digits;
  return {digits.begin(), std::to_chars(digits.begin(), digits.end(), x).ptr};
}
std::string limit(bool is_there, double x) {
  return is_there && std::isfinite(x) ? number(x) : "null";
}
std::string quoted(const std::string& text) { return nlohmann::json(text).dump(); }
std::string listed(const auto& items, const auto& write) {
  std::string list = "[";
  for (const auto& item : items) list += (list.size() == 1 ? "" : ",") + write(item);
  return list + "]";
}
std::string numbers(const auto& values) {
  return listed(values, [](auto x) { return number(x); });
}
std::string pose(const Transform& T) {
  const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows = T.matrix().topRows<3>();
  return numbers(std::span(rows.data(), 12));
}

/// Key and value of a body's shape.
std::string shape(const Body& body) {
  struct Write {
    const Body& body;
    std::string operator()(const Box& box) const { return "\"box\":" + numbers(box.size_m); }
    std::string operator()(const Sphere& ball) const {
      return "\"sphere\":" + number(ball.radius_m);
    }
    std::string operator()(const Cylinder& c) const {
      return "\"cylinder\":" + numbers(std::array{c.radius_m, c.length_m});
    }
    std::string operator()(const Capsule& c) const {
      return "\"capsule\":" + numbers(std::array{c.radius_m, c.length_m});
    }
    std::string operator()(const HalfSpace&) const { return "\"half_space\":true"; }
    std::string operator()(const std::shared_ptr<const Mesh>& mesh) const {
      const auto list = [](const auto& vector) { return numbers(vector); };
      return "\"mesh\":{\"points\":" + listed(mesh->vertices_m, list) +
             ",\"triangles\":" + listed(body.triangles(), list) + "}";
    }
  };
  if (body.members().empty()) return std::visit(Write{body}, body.shape());
  return (body.kind() == Swarm::Kind::kCubes ? "\"cubes\":" : "\"balls\":") +
         listed(body.members(), [](const Swarm::Member& one) {
           const Eigen::Vector3d& p = one.centre_m;
           return numbers(std::array{p.x(), p.y(), p.z(), one.size_m});
         });
}

std::string joint(const Joint& joint, bool has_times) {
  const bool is_bounded = joint.type != Joint::Type::kContinuous;
  return "{\"name\":" + quoted(joint.name) + ",\"lower\":" + limit(is_bounded, joint.lower) +
         ",\"upper\":" + limit(is_bounded, joint.upper) +
         ",\"velocity\":" + limit(has_times, joint.max_velocity) + "}";
}
std::string link(const Link& link, const TreeJoint& joint) {
  static constexpr const char* kMotions[] = {"fixed", "turn", "shift"};
  return "{\"name\":" + quoted(link.name) + ",\"parent\":" + number(link.parent) +
         ",\"pose\":" + pose(joint.T_parent_joint) + ",\"motion\":\"" +
         kMotions[static_cast<int>(joint.motion)] + "\",\"axis\":" + numbers(joint.axis) +
         ",\"joint\":" + number(joint.joint) + ",\"multiplier\":" + number(joint.multiplier) +
         ",\"offset\":" + number(joint.offset) + "}";
}
std::string robot_text(const KinematicTree& robot, const std::vector<Body>& bodies,
                       bool has_times) {
  const RobotDescription& of = robot.description();
  std::size_t links = 0, shapes = 0;
  return "{\"name\":" + quoted(of.name) + ",\"joints\":" +
         listed(of.joints, [&](const Joint& one) { return joint(one, has_times); }) +
         ",\"links\":" +
         listed(of.links,
                [&](const Link& one) { return link(one, robot.tree_joints()[links++]); }) +
         ",\"shapes\":" +
         listed(of.shapes,
                [&](const CollisionShape& one) {
                  return "{\"link\":" + number(one.link) + ",\"pose\":" + pose(one.T_link_shape) +
                         "," + shape(bodies[shapes++]) + "}";
                }) +
         ",\"pairs\":" +
         listed(of.self_collision_pairs,
                [](const auto& pair) {
                  return numbers(std::array{pair.first, pair.second});
                }) +
         "}";
}
std::string object_text(const CertifiedObject& object) {
  return "{\"name\":" + quoted(object.name) + ",\"pose\":" + pose(object.T_world_body) + "," +
         shape(object.body) +
         (object.may_touch.empty() ? "" : ",\"may_touch\":" + numbers(object.may_touch)) + "}";
}
std::string piece_text(const PolynomialPiece& piece) {
  return "{\"end_s\":" + number(piece.end_s) +
         ",\"joints\":" + listed(piece.coefficients, [](const auto& c) { return numbers(c); }) +
         "}";
}

}  // namespace

std::string certificate_text(const KinematicTree& robot, const std::vector<Body>& shapes,
                             const std::vector<CertifiedObject>& objects,
                             const PolynomialMotion& motion, double margin_m,
                             const std::string& claims) {
  return "{\"format\":\"sidestep-certificate-3\",\"margin_m\":" + number(margin_m) +
         ",\"robot\":" + robot_text(robot, shapes, motion.has_times) +
         ",\"objects\":" + listed(objects, object_text) +
         ",\"motion\":" + listed(motion.pieces, piece_text) + ",\"claims\":[" + claims + "]}";
}

}  // namespace sidestep
