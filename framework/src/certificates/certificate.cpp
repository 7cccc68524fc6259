#include "certificate.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include <nlohmann/json.hpp>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

void add_one(std::string& text, std::string_view more) { text += more; }
template <class Number>
requires std::is_arithmetic_v<Number>
void add_one(std::string& text, Number x) {
  std::array<char, 32> digits;
  text.append(digits.begin(), std::to_chars(digits.begin(), digits.end(), x).ptr);
}
void add(std::string& text, const auto&... more) { (add_one(text, more), ...); }

void add_list(std::string& text, const auto& items, const auto& add_item) {
  text += '[';
  bool is_first = true;
  for (const auto& item : items) {
    if (!std::exchange(is_first, false)) text += ',';
    add_item(item);
  }
  text += ']';
}
void add_numbers(std::string& text, const auto& values) {
  add_list(text, values, [&](auto x) { add_one(text, x); });
}
void add_limit(std::string& text, bool is_there, double x) {
  if (is_there && std::isfinite(x)) {
    add_one(text, x);
  } else {
    text += "null";
  }
}
void add_name(std::string& text, const std::string& name) {
  add(text, "{\"name\":", nlohmann::json(name).dump());
}
void add_pose(std::string& text, const Transform& T) {
  const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows = T.matrix().topRows<3>();
  text += ",\"pose\":";
  add_numbers(text, std::span(rows.data(), 12));
}

/// Key and value of a body's shape.
void add_shape(std::string& text, const Body& body) {
  struct Add {
    std::string& text;
    const Body& body;
    void operator()(const Box& box) const {
      text += "\"box\":";
      add_numbers(text, box.size_m);
    }
    void operator()(const Sphere& ball) const { add(text, "\"sphere\":", ball.radius_m); }
    void operator()(const Cylinder& c) const {
      add(text, "\"cylinder\":[", c.radius_m, ",", c.length_m, "]");
    }
    void operator()(const Capsule& c) const {
      add(text, "\"capsule\":[", c.radius_m, ",", c.length_m, "]");
    }
    void operator()(const HalfSpace&) const { text += "\"half_space\":true"; }
    void operator()(const std::shared_ptr<const Mesh>& mesh) const {
      const auto add_vector = [&](const auto& vector) { add_numbers(text, vector); };
      text += "\"mesh\":{\"points\":";
      add_list(text, mesh->vertices_m, add_vector);
      text += ",\"triangles\":";
      add_list(text, body.triangles(), add_vector);
      text += '}';
    }
  };
  if (body.members().empty()) return std::visit(Add{text, body}, body.shape());
  text += body.kind() == Swarm::Kind::kCubes ? "\"cubes\":" : "\"balls\":";
  add_list(text, body.members(), [&](const Swarm::Member& one) {
    const Eigen::Vector3d& p = one.centre_m;
    add_numbers(text, std::array{p.x(), p.y(), p.z(), one.size_m});
  });
}

void add_joint(std::string& text, const Joint& joint, bool has_times) {
  const bool is_bounded = joint.type != Joint::Type::kContinuous;
  add_name(text, joint.name);
  text += ",\"lower\":";
  add_limit(text, is_bounded, joint.lower);
  text += ",\"upper\":";
  add_limit(text, is_bounded, joint.upper);
  text += ",\"velocity\":";
  add_limit(text, has_times, joint.max_velocity);
  text += '}';
}
void add_link(std::string& text, const Link& link, const TreeJoint& joint) {
  static constexpr const char* kMotions[] = {"fixed", "turn", "shift"};
  add_name(text, link.name);
  add(text, ",\"parent\":", link.parent);
  add_pose(text, joint.T_parent_joint);
  add(text, ",\"motion\":\"", kMotions[static_cast<int>(joint.motion)], "\",\"axis\":");
  add_numbers(text, joint.axis);
  add(text, ",\"joint\":", joint.joint, ",\"multiplier\":", joint.multiplier,
      ",\"offset\":", joint.offset, "}");
}
void add_robot(std::string& text, const KinematicTree& robot, const std::vector<Body>& bodies,
               bool has_times) {
  const RobotDescription& of = robot.description();
  add_name(text, of.name);
  text += ",\"joints\":";
  add_list(text, of.joints, [&](const Joint& one) { add_joint(text, one, has_times); });
  text += ",\"links\":";
  auto tree_joint = robot.tree_joints().begin();
  add_list(text, of.links, [&](const Link& one) { add_link(text, one, *tree_joint++); });
  text += ",\"shapes\":";
  auto body = bodies.begin();
  add_list(text, of.shapes, [&](const CollisionShape& one) {
    add(text, "{\"link\":", one.link);
    add_pose(text, one.T_link_shape);
    text += ',';
    add_shape(text, *body++);
    text += '}';
  });
  text += ",\"pairs\":";
  add_list(text, of.self_collision_pairs,
           [&](const auto& pair) { add(text, "[", pair.first, ",", pair.second, "]"); });
  text += '}';
}
void add_object(std::string& text, const CertifiedObject& object) {
  add_name(text, object.name);
  add_pose(text, object.T_world_body);
  text += ',';
  add_shape(text, object.body);
  if (!object.may_touch.empty()) {
    text += ",\"may_touch\":";
    add_numbers(text, object.may_touch);
  }
  text += '}';
}
void add_piece(std::string& text, const PolynomialPiece& piece) {
  add(text, "{\"end_s\":", piece.end_s, ",\"joints\":");
  add_list(text, piece.coefficients, [&](const auto& c) { add_numbers(text, c); });
  text += '}';
}

}  // namespace

std::string certificate_text(const KinematicTree& robot, const std::vector<Body>& shapes,
                             const std::vector<CertifiedObject>& objects,
                             const PolynomialMotion& motion, double margin_m,
                             const std::string& claims) {
  std::string text;
  text.reserve(claims.size() + (1U << 16U));
  add(text, "{\"format\":\"sidestep-certificate-3\",\"margin_m\":", margin_m, ",\"robot\":");
  add_robot(text, robot, shapes, motion.has_times);
  text += ",\"objects\":";
  add_list(text, objects, [&](const CertifiedObject& one) { add_object(text, one); });
  text += ",\"motion\":";
  add_list(text, motion.pieces, [&](const PolynomialPiece& one) { add_piece(text, one); });
  add(text, ",\"claims\":[", claims, "]}");
  return text;
}

}  // namespace sidestep
