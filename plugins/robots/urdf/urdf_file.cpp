#include "urdf_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

#include <sidestep/core/file.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/core/xml_tags.hpp>

#include "urdf_outline.hpp"
#include "urdf_second_reading.hpp"

namespace sidestep::urdf_robot {
namespace {

/// Keeps what urdfdom prints; its output handler is global to the process, hence the mutex.
class CapturedMessages final : public console_bridge::OutputHandler {
 public:
  CapturedMessages() : lock_(mutex_), level_(console_bridge::getLogLevel()) {
    console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_WARN);
    console_bridge::useOutputHandler(this);
  }
  ~CapturedMessages() override {
    console_bridge::restorePreviousOutputHandler();
    console_bridge::setLogLevel(level_);
  }
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR && first_.empty()) first_ = text;
  }
  [[nodiscard]] const std::string& first() const noexcept { return first_; }

 private:
  static std::mutex mutex_;
  std::lock_guard<std::mutex> lock_;
  console_bridge::LogLevel level_;
  std::string first_;
};

std::mutex CapturedMessages::mutex_;

Eigen::Vector3d vector3(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

Transform transform(const urdf::Pose& pose) {
  Transform T = Transform::Identity();
  T.translate(vector3(pose.position));
  Eigen::Quaterniond rotation;
  pose.rotation.getQuaternion(rotation.x(), rotation.y(), rotation.z(), rotation.w());
  T.rotate(rotation.normalized());
  return T;
}

constexpr std::uintmax_t kMostUrdfBytes = std::uintmax_t{16} << 20;
constexpr std::size_t kMostMistakesTold = 50;

/// Nothing for a geometry that urdfdom left out.
std::optional<UrdfShape> shape_of(const urdf::Collision& collision, const SourceMark& mark) {
  UrdfShape out;
  out.mark = mark;
  out.T_link_shape = transform(collision.origin);
  if (const auto* box = dynamic_cast<const urdf::Box*>(collision.geometry.get())) {
    out.shape = Box{vector3(box->dim)};
  } else if (const auto* sphere = dynamic_cast<const urdf::Sphere*>(collision.geometry.get())) {
    out.shape = Sphere{sphere->radius};
  } else if (const auto* cylinder = dynamic_cast<const urdf::Cylinder*>(collision.geometry.get())) {
    out.shape = Cylinder{cylinder->radius, cylinder->length};
  } else if (const auto* mesh = dynamic_cast<const urdf::Mesh*>(collision.geometry.get())) {
    out.shape = std::shared_ptr<const Mesh>();
    out.mesh_uri = mesh->filename;
    out.mesh_scale = vector3(mesh->scale);
  } else {
    return {};
  }
  return out;
}

UrdfJoint joint_of(const urdf::Joint& joint, const UrdfOutline::Joint& outline) {
  UrdfJoint out;
  out.name = joint.name;
  out.mark = outline.mark;
  out.T_parent_joint = transform(joint.parent_to_joint_origin_transform);
  out.axis = vector3(joint.axis);
  switch (joint.type) {
    case urdf::Joint::REVOLUTE: out.type = UrdfJoint::Type::kRevolute; break;
    case urdf::Joint::CONTINUOUS: out.type = UrdfJoint::Type::kContinuous; break;
    case urdf::Joint::PRISMATIC: out.type = UrdfJoint::Type::kPrismatic; break;
    default: out.type = UrdfJoint::Type::kFixed; break;
  }
  if (outline.has_limits && joint.limits) {
    out.limits = UrdfLimits{joint.limits->lower, joint.limits->upper, joint.limits->velocity};
  }
  if (joint.mimic && out.type != UrdfJoint::Type::kFixed) {
    out.mimic = UrdfMimic{joint.mimic->joint_name, joint.mimic->multiplier, joint.mimic->offset};
  }
  return out;
}

/// Makes the axis of a joint that moves as long as 1.
void normalise_axis(UrdfJoint& joint, std::vector<Error>& errors) {
  if (joint.type == UrdfJoint::Type::kFixed) return;
  const double length = joint.axis.norm();
  if (length > 1e-9 && std::isfinite(length)) {
    joint.axis /= length;
    return;
  }
  errors.push_back({ErrorCode::kConfig, "joint '" + joint.name + "' has an axis of no length",
                    joint.mark.to_string()});
}

/// How many elements of a text lie in the elements of these names, the last their own.
template <std::size_t kDepth>
std::size_t count_elements(std::string_view text,
                           const std::array<std::string_view, kDepth>& path) {
  std::size_t count = 0;
  visit_elements(text, "?>", [&](auto names) { count += std::ranges::equal(names, path); });
  return count;
}

/// The last net: what was lost on the way from the text to the model, for whatever reason.
void check_counts(const UrdfModel& model, const std::string& text, std::vector<Error>& errors) {
  const auto check = [&](std::size_t written, const std::string& element, std::size_t read,
                         const std::string& what) {
    if (read == written) return;
    errors.push_back({ErrorCode::kConfig,
                      "the URDF has " + std::to_string(written) + " <" + element +
                          "> elements, and " + std::to_string(read) + " " + what + " were read",
                      model.file.string(), "the file may go on behind the end of its <robot>"});
  };
  std::size_t shapes = 0, joints = 0;
  for (const UrdfLink& link : model.links) {
    shapes += link.shapes.size();
    joints += link.joint ? 1 : 0;
  }
  using Path = std::array<std::string_view, 2>;
  check(count_collisions(text), "collision", shapes, "collision shapes");
  check(count_elements(text, Path{"robot", "link"}), "link", model.links.size(), "links");
  check(count_elements(text, Path{"robot", "joint"}), "joint", joints, "joints");
}

UrdfModel build_model(const urdf::ModelInterface& parsed, const UrdfOutline& outline,
                      std::vector<Error>& errors) {
  UrdfModel model;
  model.name = outline.robot_name;
  std::vector<int> placed(outline.links.size(), -1);
  for (const int index : outline.order) {
    const UrdfOutline::Link& entry = outline.links[idx(index)];
    UrdfLink link;
    link.name = entry.name;
    link.has_visual = entry.has_visual;
    link.mark = entry.mark;
    const auto parsed_link = parsed.getLink(entry.name);
    for (std::size_t i = 0; i < parsed_link->collision_array.size(); ++i) {
      const SourceMark mark = i < entry.collisions.size() ? entry.collisions[i] : entry.mark;
      auto shape = shape_of(*parsed_link->collision_array[i], mark);
      if (shape) link.shapes.push_back(std::move(*shape));
    }
    if (entry.parent_joint != -1) {
      const auto& joint = outline.joints[idx(entry.parent_joint)];
      link.parent = placed[idx(outline.link(joint.parent))];
      link.joint = joint_of(*parsed.getJoint(joint.name), joint);
      normalise_axis(*link.joint, errors);
    }
    placed[idx(index)] = static_cast<int>(model.links.size());
    model.links.push_back(std::move(link));
  }
  return model;
}

}  // namespace

const UrdfJoint* UrdfModel::find_joint(const std::string& joint_name) const noexcept {
  const auto it = std::ranges::find_if(
      links, [&](const UrdfLink& link) { return link.joint && link.joint->name == joint_name; });
  return it == links.end() ? nullptr : &*it->joint;
}

std::optional<int> UrdfModel::link_index(const std::string& link_name) const noexcept {
  const auto it = std::ranges::find(links, link_name, &UrdfLink::name);
  if (it == links.end()) return {};
  return static_cast<int>(it - links.begin());
}

std::vector<std::string> UrdfModel::joint_names() const {
  std::vector<std::string> names;
  for (const UrdfLink& link : links) {
    if (link.joint && link.joint->type != UrdfJoint::Type::kFixed)
      names.push_back(link.joint->name);
  }
  return names;
}

std::vector<std::string> UrdfModel::link_names() const {
  std::vector<std::string> names;
  for (const UrdfLink& link : links) names.push_back(link.name);
  return names;
}

std::optional<UrdfModel> read_urdf(const std::filesystem::path& file, std::vector<Error>& errors) {
  const auto read = read_file(file, kMostUrdfBytes);
  if (!read) {
    errors.push_back(read.error());
    return {};
  }
  const std::string& text = *read;
  const std::size_t before = errors.size();
  std::vector<Error> mistakes;
  const UrdfOutline outline = outline_urdf(text, file.string(), mistakes);
  if (mistakes.empty()) {
    CapturedMessages messages;
    const auto parsed = urdf::parseURDF(outline.reduced_text);
    if (parsed == nullptr || !messages.first().empty()) {
      mistakes.push_back(
          {ErrorCode::kConfig,
           "the URDF cannot be read: " +
               (messages.first().empty() ? std::string("no reason is known") : messages.first()),
           file.string()});
    } else {
      UrdfModel model = build_model(*parsed, outline, mistakes);
      model.file = file;
      check_counts(model, text, mistakes);
      check_second_reading(model, text, mistakes);
      if (mistakes.empty()) return model;
    }
  }
  errors.insert(errors.begin() + static_cast<std::ptrdiff_t>(before), mistakes.begin(),
                mistakes.end());
  return {};
}

Error all_of(std::vector<Error> errors, const std::string& what) {
  if (errors.size() == 1) return std::move(errors.front());
  std::string message = what + " has " + std::to_string(errors.size()) + " mistakes:";
  const std::size_t told = std::min(errors.size(), kMostMistakesTold);
  for (std::size_t i = 0; i < told; ++i) message += "\n  " + errors[i].describe();
  if (told < errors.size()) {
    message += "\n  and " + std::to_string(errors.size() - told) + " more";
  }
  return Error{errors.front().code, std::move(message), {}};
}

std::size_t count_collisions(std::string_view text) {
  return count_elements(text, std::array<std::string_view, 3>{"robot", "link", "collision"});
}

}  // namespace sidestep::urdf_robot
