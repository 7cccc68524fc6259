#include "urdf_comparison.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <deque>
#include <limits>
#include <numbers>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

#include "build_robot.hpp"
#include "urdf_file.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using urdf_robot::UrdfJoint;
using urdf_robot::UrdfLink;
using urdf_robot::UrdfModel;

/// 0, or what is nearest to it within the limits.
double rest_value(const UrdfJoint& joint) {
  if (!joint.limits || joint.type == UrdfJoint::Type::kContinuous) return 0.0;
  const auto [lower, upper, velocity] = *joint.limits;
  return lower > upper ? 0.0 : std::clamp(0.0, lower, upper);
}

/// The robot's joint of this name, fixed, planned or neither; null where there is none.
const TreeJoint* find_joint(const KinematicTree& robot, const std::string& name) {
  const auto& joints = robot.tree_joints();
  const auto found = std::ranges::find(joints, name, &TreeJoint::name);
  return found == joints.end() ? nullptr : &*found;
}

/// A URDF whose joints do what those of the same names do in a robot's profile; joints that mimic
/// others follow them as the URDF says. The URDF and the robot outlive it. [any]
class UrdfMotion {
 public:
  /// A joint's value: multiplier * q[joint] + offset.
  struct Value {
    int joint = -1;  ///< Of the robot's planned ones; -1 where it is at rest.
    double multiplier = 1.0;
    double offset = 0.0;
  };

  UrdfMotion(const urdf_robot::UrdfModel& urdf, const KinematicTree& robot);

  /// Of the joint from a link's parent; at rest for the root and fixed joints.
  [[nodiscard]] const Value& value(std::size_t link) const noexcept { return values_[link]; }
  /// Poses of the URDF's links, in its root's frame. q: the robot's.
  [[nodiscard]] std::vector<Transform> link_poses(std::span<const double> q) const;

 private:
  [[nodiscard]] Value value_of(const urdf_robot::UrdfJoint& joint) const;

  const urdf_robot::UrdfModel& urdf_;
  const KinematicTree& robot_;
  std::vector<Value> values_;  // per link
};

UrdfMotion::UrdfMotion(const urdf_robot::UrdfModel& urdf, const KinematicTree& robot)
    : urdf_(urdf), robot_(robot) {
  for (const urdf_robot::UrdfLink& link : urdf.links) {
    const bool moves = link.joint && link.joint->type != UrdfJoint::Type::kFixed;
    values_.push_back(moves ? value_of(*link.joint) : Value{});
  }
}

UrdfMotion::Value UrdfMotion::value_of(const UrdfJoint& joint) const {
  if (joint.mimic) {
    const UrdfJoint* const master = urdf_.find_joint(joint.mimic->joint);
    Value value = master == nullptr ? Value{} : value_of(*master);
    value.multiplier *= joint.mimic->multiplier;
    value.offset = joint.mimic->multiplier * value.offset + joint.mimic->offset;
    return value;
  }
  const TreeJoint* const own = find_joint(robot_, joint.name);
  if (own == nullptr || own->motion == TreeJoint::Motion::kFixed)
    return {.offset = rest_value(joint)};
  return {own->joint, own->multiplier, own->offset};
}

std::vector<Transform> UrdfMotion::link_poses(std::span<const double> q) const {
  std::vector<Transform> poses;
  poses.reserve(urdf_.links.size());
  for (std::size_t i = 0; i < urdf_.links.size(); ++i) {
    const urdf_robot::UrdfLink& link = urdf_.links[i];
    if (link.parent == -1 || !link.joint) {
      poses.push_back(Transform::Identity());
      continue;
    }
    Transform T = poses[static_cast<std::size_t>(link.parent)] * link.joint->T_parent_joint;
    const Value& value = values_[i];
    double at = value.offset;
    if (value.joint != -1) at += value.multiplier * q[static_cast<std::size_t>(value.joint)];
    switch (link.joint->type) {
      case UrdfJoint::Type::kFixed: break;
      case UrdfJoint::Type::kPrismatic: T.translate(at * link.joint->axis); break;
      default: T.rotate(Eigen::AngleAxisd(at, link.joint->axis));
    }
    poses.push_back(T);
  }
  return poses;
}

constexpr int kCorners = 32;        // configurations with each joint at one of its limits
constexpr int kBetween = 32;        // and anywhere within them
constexpr double kRounding = 1e-6;  // of limits

std::string listed(const std::string& list, const std::string& item) {
  return list.empty() ? item : list + ", " + item;
}

/// Why a mesh cannot be read, in the command's words.
Error mesh_error(Error error, const UrdfLink& link) {
  error.message = "link '" + link.name + "': " + error.message;
  if (error.code == ErrorCode::kNotFound) {
    const std::size_t tried = error.hint.find("; tried");
    error.hint = "name the folder that its package is in with --package-path" +
                 (tried == std::string::npos ? std::string() : error.hint.substr(tried));
  }
  return error;
}

/// Reads the meshes that the shapes name.
Result<void> load_meshes(UrdfModel& urdf, const std::vector<std::string>& package_paths) {
  const urdf_robot::MeshFinder finder(urdf.file, urdf_robot::package_paths_of(package_paths));
  std::vector<Error> errors;
  for (UrdfLink& link : urdf.links) {
    for (urdf_robot::UrdfShape& shape : link.shapes) {
      if (shape.mesh_uri.empty()) continue;
      auto mesh = finder.load(shape.mesh_uri, shape.mesh_scale, shape.mark);
      if (mesh) {
        shape.shape = std::move(*mesh);
      } else {
        errors.push_back(mesh_error(std::move(mesh.error()), link));
      }
    }
  }
  if (errors.empty()) return {};
  return tl::make_unexpected(urdf_robot::all_of(std::move(errors), "the URDF"));
}

/// The default configuration, and corners and insides of the limits; a base stays where it is.
std::vector<std::vector<double>> configurations_of(const RobotDescription& robot,
                                                   std::size_t base_joints) {
  std::mt19937_64 random(1);
  const auto share = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  std::vector<std::vector<double>> configurations;
  for (int i = 0; i < 1 + kCorners + kBetween; ++i) {
    std::vector<double>& q = configurations.emplace_back();
    for (std::size_t j = 0; j < robot.joints.size(); ++j) {
      const Joint& joint = robot.joints[j];
      const double lower = std::isfinite(joint.lower) ? joint.lower : -std::numbers::pi;
      const double upper = std::isfinite(joint.upper) ? joint.upper : std::numbers::pi;
      const double drawn = i <= kCorners ? std::round(share()) : share();
      const bool is_default = i == 0 || j < base_joints;
      q.push_back(is_default ? std::clamp(0.0, lower, upper) : lower + drawn * (upper - lower));
    }
  }
  return configurations;
}

/// Adds to a comparison part by part.
class Comparer {
 public:
  Comparer(const KinematicTree& robot, const UrdfModel& urdf)
      : robot_(robot),
        base_joints_(urdf_robot::base_joints(robot)),
        urdf_(urdf),
        motion_(urdf, robot) {
    for (const UrdfLink& link : urdf.links) own_link_.push_back(own_link(link.name));
  }

  UrdfComparison run() {
    compare_joints();
    note_held_joints();
    if (!compare_poses()) return std::move(out_);
    compare_shapes();
    return std::move(out_);
  }

 private:
  [[nodiscard]] const RobotDescription& description() const { return robot_.description(); }

  /// The profile's link of this name, if a URDF can have it; else -1.
  [[nodiscard]] int own_link(const std::string& name) const {
    const auto link = description().link_index(name);
    return link && idx(*link) >= base_joints_ ? *link : -1;  // as many links as joints
  }

  [[nodiscard]] bool is_planned(std::size_t link) const { return motion_.value(link).joint != -1; }

  void compare_joints() {
    const auto& joints = description().joints;
    for (std::size_t j = base_joints_; j < joints.size(); ++j) {
      const UrdfJoint* const joint = urdf_.find_joint(joints[j].name);
      if (joint == nullptr) {
        const std::string nearest = nearest_name(joints[j].name, urdf_.joint_names());
        out_.findings.push_back("the profile plans joint '" + joints[j].name +
                                "', which the URDF lacks" +
                                (nearest.empty() ? "" : " (is it '" + nearest + "'?)"));
      } else if (joint->type == UrdfJoint::Type::kFixed || joint->mimic) {
        out_.findings.push_back(
            "the profile plans joint '" + joint->name + "', which " +
            (joint->mimic ? "mimics '" + joint->mimic->joint + "'" : std::string("is fixed")) +
            " in the URDF");
      } else {
        compare_limits(joints[j], *joint);
      }
    }
    for (const UrdfLink& link : urdf_.links) {
      if (!link.joint || link.joint->mimic || link.joint->type == UrdfJoint::Type::kFixed) continue;
      const TreeJoint* const own = find_joint(robot_, link.joint->name);
      if (own == nullptr || own->joint == -1) continue;
      const std::string& master = joints[idx(own->joint)].name;
      if (master == own->name) continue;
      out_.findings.push_back("joint '" + own->name + "' follows '" + master +
                              "' in the profile and moves by itself in the URDF");
    }
  }

  void compare_limits(const Joint& own, const UrdfJoint& joint) {
    if (!joint.limits) return;
    const auto [lower, upper, velocity] = *joint.limits;
    const bool is_limited = joint.type != UrdfJoint::Type::kContinuous;
    if (is_limited && (own.lower < lower - kRounding || own.upper > upper + kRounding)) {
      out_.findings.push_back("the profile plans joint '" + own.name + "' from " +
                              format("%.6g to %.6g %s; the URDF allows %.6g to %.6g", own.lower,
                                     own.upper, own.unit(), lower, upper));
    }
    if (velocity > 0.0 && own.max_velocity > velocity + kRounding) {
      out_.findings.push_back(
          "the profile plans joint '" + own.name + "' at up to " +
          format("%.6g %s/s; the URDF allows %.6g", own.max_velocity, own.unit(), velocity));
    }
  }

  /// Joints at rest that could move a link with shapes, those included that others mimic.
  void note_held_joints() {
    std::vector<bool> carries(urdf_.links.size(), false);
    std::vector<bool> moves(urdf_.links.size(), false);
    for (std::size_t i = urdf_.links.size(); i-- > 0;) {
      if (!urdf_.links[i].shapes.empty()) carries[i] = true;
      if (!carries[i] || urdf_.links[i].parent == -1) continue;
      carries[idx(urdf_.links[i].parent)] = true;
      moves[master_of(i)] = true;
    }
    std::string held, unknown;
    for (std::size_t i = 0; i < urdf_.links.size(); ++i) {
      const auto& joint = urdf_.links[i].joint;
      if (!moves[i] || is_planned(i) || joint->type == UrdfJoint::Type::kFixed) continue;
      const bool is_stiff = joint->type != UrdfJoint::Type::kContinuous && joint->limits &&
                            joint->limits->lower == joint->limits->upper;
      if (is_stiff) continue;
      std::string& list = find_joint(robot_, joint->name) == nullptr ? unknown : held;
      list = listed(list, joint->name + format(" at %.4g", motion_.value(i).offset));
    }
    if (!held.empty()) out_.notes.push_back("held still, as the profile says: " + held);
    if (!unknown.empty()) {
      out_.notes.push_back("unknown to the profile and taken at rest: " + unknown);
    }
  }

  /// The link whose joint moves this one's, by way of all that mimic others.
  [[nodiscard]] std::size_t master_of(std::size_t link) const {
    while (urdf_.links[link].joint->mimic) {
      const std::string& name = urdf_.links[link].joint->mimic->joint;
      const auto found = std::ranges::find_if(
          urdf_.links, [&](const UrdfLink& one) { return one.joint && one.joint->name == name; });
      if (found == urdf_.links.end()) break;
      link = static_cast<std::size_t>(found - urdf_.links.begin());
    }
    return link;
  }

  /// False where the profile does not move as the URDF does.
  bool compare_poses() {
    const auto first = std::ranges::find_if(own_link_, [](int own) { return own != -1; });
    if (first == own_link_.end()) {
      out_.findings.push_back("the profile and the URDF have no link in common");
      return false;
    }
    const auto origin = static_cast<std::size_t>(first - own_link_.begin());
    std::vector<LinkOffset> offsets(urdf_.links.size());
    std::vector<Transform> own_poses(description().links.size());
    Scratch scratch;
    const auto configurations = configurations_of(description(), base_joints_);
    for (const std::vector<double>& q : configurations) {
      robot_.link_poses(q, own_poses, scratch);
      const std::vector<Transform> poses = motion_.link_poses(q);
      const Transform T_world_root = own_poses[idx(*first)] * poses[origin].inverse();
      for (std::size_t i = 0; i < poses.size(); ++i) {
        if (own_link_[i] == -1) continue;
        const Transform T_own_link =
            own_poses[idx(own_link_[i])].inverse() * T_world_root * poses[i];
        offsets[i].offset_m = std::max(offsets[i].offset_m, T_own_link.translation().norm());
        const double turn = Eigen::AngleAxisd(T_own_link.rotation()).angle();
        offsets[i].turn_rad = std::max(offsets[i].turn_rad, turn);
      }
    }
    out_.configurations = static_cast<int>(configurations.size());
    bool are_same = true;
    for (std::size_t i = 0; i < offsets.size(); ++i) {
      if (own_link_[i] == -1) continue;
      offsets[i].link = urdf_.links[i].name;
      if (!offsets[i].is_small()) {
        are_same = false;
        out_.findings.push_back("link '" + offsets[i].link +
                                format("' is %.2f mm and %.2f mrad from where the profile has it",
                                       1e3 * offsets[i].offset_m, 1e3 * offsets[i].turn_rad));
      }
      out_.offsets.push_back(std::move(offsets[i]));
    }
    return are_same;
  }

  void compare_shapes() {
    std::vector<RigidBody> bodies = rigid_bodies(robot_);
    for (RigidBody& body : bodies) {
      for (BodyPart& part : body.parts) {
        const auto* const mesh = std::get_if<std::shared_ptr<const Mesh>>(&part.shape);
        if (mesh != nullptr) part.shape = indexed_mesh(**mesh);
      }
    }
    const auto configurations = configurations_of(description(), base_joints_);
    const std::vector<Transform> rest = motion_.link_poses(configurations.front());
    if (description().shapes.empty()) {
      out_.notes.push_back("the profile has spheres alone: no shapes are held against the URDF");
    }
    std::string bare;
    bool has_shapes = false;
    for (std::size_t i = 0; i < urdf_.links.size(); ++i) {
      const UrdfLink& link = urdf_.links[i];
      if (link.shapes.empty() && link.has_visual) {
        bare = listed(bare, link.name);
        ++out_.bare_links;
      }
      if (link.shapes.empty()) continue;
      has_shapes = true;
      const auto with = moves_with(i);
      if (!with) {
        out_.findings.push_back("link '" + link.name +
                                "' has collision shapes, and the profile has no link that moves "
                                "with it");
        continue;
      }
      const int own = own_link_[*with];
      const auto body = std::ranges::find_if(
          bodies, [&](const RigidBody& one) { return one.find(own) != nullptr; });
      compare_link(link, urdf_.links[*with].name,
                   body->find(own)->T_body_link * rest[*with].inverse() * rest[i], *body);
    }
    if (!bare.empty()) {
      out_.notes.push_back("with visual shapes but no collision shapes, which alone count: " +
                           bare);
    }
    if (!has_shapes) out_.findings.emplace_back("the URDF has no collision shapes");
  }

  /// The nearest link that the profile has, too, by way of joints that are not planned.
  [[nodiscard]] std::optional<std::size_t> moves_with(std::size_t link) const {
    std::deque<std::size_t> open{link};
    std::vector<bool> seen(urdf_.links.size(), false);
    seen[link] = true;
    while (!open.empty()) {
      const std::size_t i = open.front();
      open.pop_front();
      if (own_link_[i] != -1) return i;
      const auto go_to = [&](std::size_t next) {
        if (!seen[next]) open.push_back(next);
        seen[next] = true;
      };
      const int parent = urdf_.links[i].parent;
      if (parent != -1 && !is_planned(i)) go_to(idx(parent));
      for (std::size_t child = 0; child < urdf_.links.size(); ++child) {
        if (urdf_.links[child].parent == static_cast<int>(i) && !is_planned(child)) go_to(child);
      }
    }
    return {};
  }

  void compare_link(const UrdfLink& link, const std::string& with, const Transform& T_body_link,
                    const RigidBody& body) {
    Mesh surface;  // in the body's frame
    double error_m = 0.0;
    for (const urdf_robot::UrdfShape& shape : link.shapes) {
      error_m = std::max(error_m, facet_error_m(shape.shape));
      const Mesh own = surface_of(shape.shape);
      const auto first = static_cast<int>(surface.vertices_m.size());
      for (const Eigen::Vector3d& vertex : own.vertices_m) {
        surface.vertices_m.push_back(T_body_link * shape.T_link_shape * vertex);
      }
      for (const Eigen::Vector3i& triangle : own.triangles) {
        surface.triangles.push_back(triangle + Eigen::Vector3i::Constant(first));
      }
    }
    const std::vector<BodySphere> spheres = spheres_of(body, description().spheres);
    LinkAgainst against{link.name, with, {}, {}};
    const auto held = [&](const DistanceTo& distance_m, const char* what) {
      StandingOut out = standing_out(surface, distance_m, kMostStandingOut_m - error_m);
      out.at_most_m += error_m;
      const Eigen::Vector3d p_link = T_body_link.inverse() * out.p_farthest;
      out.p_farthest = (p_link * 1e6).array().round() / 1e6 + 0.0;  // no -0
      if (out.at_most_m > kMostStandingOut_m) add_finding(link.name, what, out);
      return out;
    };
    if (!description().shapes.empty()) {
      against.shapes = held([&](const auto& p) { return signed_distance_m(body, p); }, "shapes");
    }
    against.spheres = held([&](const auto& p) { return signed_distance_m(spheres, p); }, "spheres");
    out_.links.push_back(std::move(against));
  }

  void add_finding(const std::string& link, const std::string& what, const StandingOut& out) {
    const Eigen::Vector3d& p = out.p_farthest;
    std::string finding = "link '" + link + "' ";
    if (std::isinf(out.farthest_m)) {
      finding += "moves with none of the profile's " + what;
    } else {
      finding +=
          "stands out of the profile's " + what +
          format(" by %.1f mm at (%.3f, %.3f, %.3f)", 1e3 * out.farthest_m, p.x(), p.y(), p.z());
      if (out.farthest_m <= kMostStandingOut_m) {
        finding += format(", and by no more than %.1f mm elsewhere", 1e3 * out.at_most_m);
      }
    }
    out_.findings.push_back(std::move(finding));
  }

  const KinematicTree& robot_;
  std::size_t base_joints_;
  const UrdfModel& urdf_;
  UrdfMotion motion_;
  std::vector<int> own_link_;  // of each of the URDF's links; -1 for none
  UrdfComparison out_;
};

}  // namespace

Result<UrdfComparison> compare_with_urdf(const KinematicTree& robot, const fs::path& urdf,
                                         const std::vector<std::string>& package_paths) {
  std::vector<Error> errors;
  auto model = urdf_robot::read_urdf(urdf, errors);
  if (!model) return tl::make_unexpected(urdf_robot::all_of(std::move(errors), "the URDF"));
  SIDESTEP_TRY(load_meshes(*model, package_paths));
  return Comparer(robot, *model).run();
}

}  // namespace sidestep
