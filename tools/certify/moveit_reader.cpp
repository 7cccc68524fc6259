#include <algorithm>

#include <sidestep/core/file.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "motion_reader.hpp"

namespace sidestep {
namespace {

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

class MoveItMotion {
 public:
  MoveItMotion(const Node& message, const RobotDescription& robot)
      : message_(message), robot_(robot) {}

  [[nodiscard]] Result<MotionSamples> read() {
    const Node* trajectory = &message_;
    const Node* const start = message_.find("trajectory_start");
    if (start != nullptr && has_items(*start, "attached_collision_objects")) {
      for (const Node& attached : start->find("attached_collision_objects")->items()) {
        const Node* const object = attached.find("object");
        const Node* const id = object != nullptr ? object->find("id") : nullptr;
        if (id != nullptr && robot_.link_index(id->text())) continue;
        return wrong(attached, "what the robot carries is read from the scene, which lacks this");
      }
    }
    if (const Node* const shown = trajectory->find("trajectory"); shown && shown->is_list()) {
      if (shown->items().size() != 1) return wrong(*shown, "one trajectory is wanted");
      trajectory = &shown->items().front();
    }
    if (const Node* const many = trajectory->find("multi_dof_joint_trajectory")) {
      if (has_items(*many, "points"))
        return wrong(*many, "joints of several degrees of freedom are not read");
    }
    if (const Node* const joints = trajectory->find("joint_trajectory")) trajectory = joints;
    const Node& names = *SIDESTEP_TRY(entry(*trajectory, "joint_names"));
    std::vector<std::string> listed;
    for (const Node& name : names.items()) listed.push_back(name.text());
    order_ = SIDESTEP_TRY(joint_order(listed, robot_, [&](std::optional<std::size_t> i) {
      return (i ? names.items()[*i] : names).error("").where;
    }));
    const Node& points = *SIDESTEP_TRY(entry(*trajectory, "points"));
    if (points.items().size() < 2) return wrong(points, "a motion has two points at least");
    const Node& first = points.items().front();
    samples_.has_velocities = has_items(first, "velocities");
    samples_.has_accelerations = has_items(first, "accelerations");
    for (const Node& point : points.items()) SIDESTEP_TRY(read_point(point));
    return std::move(samples_);
  }

 private:
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

}  // namespace

Result<Node> read_message(const std::filesystem::path& file) {
  std::string message = SIDESTEP_TRY(read_file(file));
  if (message.find_first_not_of(" \n\r\t") == std::string::npos) {
    return fail(ErrorCode::kConfig, "is empty", file.string());
  }
  while (!message.empty() &&
         std::string_view("-.\n\r ").find(message.back()) != std::string::npos) {
    message.pop_back();
  }
  std::vector<Error> errors;
  auto document = SIDESTEP_TRY(parse_yaml(message, file.string(), errors));
  if (!errors.empty()) return tl::make_unexpected(errors.front());
  return document;
}

Result<MotionSamples> read_moveit_motion(const std::filesystem::path& file,
                                         const RobotDescription& robot) {
  const auto message = SIDESTEP_TRY(read_message(file));
  return MoveItMotion(message, robot).read();
}

}  // namespace sidestep
