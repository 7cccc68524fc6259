#include <sidestep/runtime/task_settings.hpp>

#include <algorithm>
#include <limits>
#include <utility>

#include <sidestep/core/format.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/entry_reading.hpp>

namespace sidestep {
namespace {

constexpr double kFarthest_m = 1e3;

/// Reads blocks of a plan into terms.
class TaskReader {
 public:
  TaskReader(const std::shared_ptr<const RobotModel>& robot, Task& task, std::vector<Error>& errors)
      : robot_(robot), description_(robot->description()), task_(task), errors_(errors) {}

  void read_end_effector(const Node* block) {
    EndEffectorEntry entry;
    if (block == nullptr || !read_entry(*block, entry) || !has_link(*block)) return;
    if (!agrees(*block, entry)) return;
    PoseFreedom freedom{.within_m = entry.within_m};
    for (const auto& other : entry.alternatives) freedom.alternatives.push_back(other.pose());
    task_.frees_goal = true;
    task_.target = entry;
    add(*block, Placement::kGoal,
        entry.rpy_rad
            ? make_link_pose_cost(robot_, entry.link, entry.pose(), entry.sigma_position_m,
                                  entry.sigma_rotation_rad, freedom)
            : make_link_position_cost(robot_, entry.link, entry.position_m, entry.sigma_position_m,
                                      freedom));
    if (!entry.axis_link) return;
    add(*block, Placement::kGoal,
        make_link_axis_cost(robot_, entry.link, *entry.axis_link, entry.axis_world,
                            entry.sigma_rotation_rad));
  }

  void read_orientation(const Node& block) {
    OrientationCostEntry entry;
    if (!read_entry(block, entry) || !has_link(block)) return;
    const Transform target = transform_from_xyz_rpy(Eigen::Vector3d::Zero(), entry.rpy_rad);
    add(block, Placement::kSupportAndInterpolated,
        make_link_orientation_cost(robot_, entry.link, target.linear(), entry.sigma_rad));
  }

  void read_axis(const Node& block) {
    AxisCostEntry entry;
    if (!read_entry(block, entry) || !has_link(block)) return;
    add(block, Placement::kSupportAndInterpolated,
        make_link_axis_cost(robot_, entry.link, entry.axis_link, entry.axis_world,
                            entry.sigma_rad));
  }

  void read_posture(const Node* block) {
    PostureCostEntry entry;
    if (block == nullptr || !read_entry(*block, entry)) return;
    if (!entry.joints.is_map()) {
      errors_.push_back(entry.joints.error("expected a map of joint names to values, found " +
                                           entry.joints.kind()));
      return;
    }
    const int dof = description_.dof();
    Eigen::VectorXd q = Eigen::VectorXd::Zero(dof);
    Eigen::VectorXd sigmas =
        Eigen::VectorXd::Constant(dof, std::numeric_limits<double>::infinity());
    const std::size_t before = errors_.size();
    for (const Node::Entry& joint : entry.joints.entries()) {
      const auto value = joint.value.as_double();
      const auto index = description_.joint_index(joint.key);
      if (!value) errors_.push_back(value.error());
      if (!index) {
        errors_.push_back(unknown_name("robot '" + description_.name + "' has no joint", joint.key,
                                       joint.key_mark.to_string(), names_of(description_.joints)));
      }
      if (!value || !index) continue;
      q[*index] = *value;
      sigmas[*index] = entry.sigma;
    }
    if (errors_.size() == before) {
      add(*block, Placement::kSupport, make_posture_cost(description_, q, sigmas));
    }
  }

 private:
  /// Whether what a goal says of the link's orientation is one thing.
  bool agrees(const Node& block, const EndEffectorEntry& entry) {
    const std::size_t before = errors_.size();
    if (entry.axis_link && entry.rpy_rad) {
      errors_.push_back(
          block.find("axis_link")
              ->error("`rpy_rad` says already how the link is turned", "leave one of the two out"));
    }
    if (!entry.axis_link && block.find("axis_world") != nullptr) {
      errors_.push_back(block.find("axis_world")
                            ->error("there is no `axis_link` that is to have this direction"));
    }
    for (std::size_t i = 0; i < entry.alternatives.size(); ++i) {
      if (entry.alternatives[i].rpy_rad.has_value() == entry.rpy_rad.has_value()) continue;
      errors_.push_back(
          block.find("alternatives")
              ->items()[i]
              .error(entry.rpy_rad
                         ? "this alternative has no `rpy_rad`, as the goal itself has"
                         : "this alternative has an `rpy_rad`, and the goal itself has none",
                     "give it to all of them or to none"));
    }
    return errors_.size() == before;
  }

  bool has_link(const Node& block) {
    return sidestep::has_link(description_, *block.find("link"), errors_);
  }

  void add(const Node& block, Placement placement, Result<std::unique_ptr<StateCost>> cost) {
    if (cost) {
      task_.terms.push_back({std::move(*cost), placement});
    } else {
      errors_.push_back(block.error(cost.error().message));
    }
  }

  const std::shared_ptr<const RobotModel>& robot_;
  const RobotDescription& description_;
  Task& task_;
  std::vector<Error>& errors_;
};

}  // namespace

namespace {

template <class Entry>
Parameters<Entry> declare_pose(Parameters<Entry> parameters) {
  return std::move(parameters)
      .add("position_m", &Entry::position_m, "Position of the link's origin, world frame.",
           {.unit = "m", .min = -kFarthest_m, .max = kFarthest_m, .required = true})
      .add("rpy_rad", &Entry::rpy_rad,
           "Its roll, pitch and yaw about the world's axes; if absent, any orientation will do.",
           {.unit = "rad"});
}

}  // namespace

Parameters<AlternativeEntry> AlternativeEntry::parameters() {
  return declare_pose(Parameters<AlternativeEntry>());
}

Parameters<EndEffectorEntry> EndEffectorEntry::parameters() {
  using E = EndEffectorEntry;
  return declare_pose(Parameters<E>().add("link", &E::link,
                                          "The link that is to be somewhere; also the name of "
                                          "something attached, e.g. a tool's frame.",
                                          {.required = true}))
      .add("within_m", &E::within_m,
           "Half the edges, along the world's axes, of a box about the position anywhere in which "
           "will do.",
           {.unit = "m", .min = 0.0, .max = kFarthest_m})
      .add("axis_link", &E::axis_link,
           "In place of `rpy_rad`: an axis in the link's frame that is to have the direction "
           "`axis_world`, however the link is turned about it.")
      .add("axis_world", &E::axis_world, "That direction, world frame.")
      .add("alternatives", &E::alternatives,
           "Other places that will do as well, with `rpy_rad` if the goal itself has one: the "
           "nearest counts.")
      .add("sigma_position_m", &E::sigma_position_m,
           "Standard deviation of the position; a plan that ends further than three of them away "
           "fails.",
           {.unit = "m", .min = 1e-6})
      .add("sigma_rotation_rad", &E::sigma_rotation_rad,
           "Standard deviation of the orientation, likewise.", {.unit = "rad", .min = 1e-6});
}

Parameters<OrientationCostEntry> OrientationCostEntry::parameters() {
  using E = OrientationCostEntry;
  return Parameters<E>()
      .add("link", &E::link, "The link whose orientation is to be held.", {.required = true})
      .add("rpy_rad", &E::rpy_rad, "Its roll, pitch and yaw about the world's axes.",
           {.unit = "rad", .required = true})
      .add("sigma_rad", &E::sigma_rad, "Standard deviation of the angle.",
           {.unit = "rad", .min = 1e-6});
}

Parameters<AxisCostEntry> AxisCostEntry::parameters() {
  using E = AxisCostEntry;
  return Parameters<E>()
      .add("link", &E::link, "The link whose axis is to be kept, e.g. upright.", {.required = true})
      .add("axis_link", &E::axis_link, "The axis, in the link's frame.")
      .add("axis_world", &E::axis_world, "The direction that it is to have, world frame.")
      .add("sigma_rad", &E::sigma_rad, "Standard deviation of the angle between the two.",
           {.unit = "rad", .min = 1e-6});
}

Parameters<PostureCostEntry> PostureCostEntry::parameters() {
  using E = PostureCostEntry;
  return Parameters<E>()
      .add("joints", &E::joints,
           "Preferred positions by joint name (m, rad); other joints are left alone.",
           {.required = true})
      .add("sigma", &E::sigma, "Standard deviation of each of them (m, rad).", {.min = 1e-6});
}

Task read_task(const Node& plan, const std::shared_ptr<const RobotModel>& robot,
               std::vector<Error>& errors) {
  Task task;
  TaskReader reader(robot, task, errors);
  reader.read_end_effector(plan.find("end_effector"));
  if (const Node* list = plan.find("orientation_costs")) {
    for (const Node& block : list->items()) reader.read_orientation(block);
  }
  if (const Node* list = plan.find("axis_costs")) {
    for (const Node& block : list->items()) reader.read_axis(block);
  }
  reader.read_posture(plan.find("posture_cost"));
  return task;
}

std::string target_below_floor(const Task& task, const std::optional<FloorEntry>& floor) {
  if (!floor || !task.target) return "";
  double highest_m = task.target->position_m.z();
  for (const auto& other : task.target->alternatives) {
    highest_m = std::max(highest_m, other.position_m.z());
  }
  const double below_m = floor->height_m - highest_m - task.target->within_m.z();
  const auto& excepted = floor->except_links;
  if (below_m <= 0.0 || std::ranges::find(excepted, task.target->link) != excepted.end()) return "";
  return task.target->link + " is to be " + format("%.3f m", below_m) + " below the floor";
}

}  // namespace sidestep
