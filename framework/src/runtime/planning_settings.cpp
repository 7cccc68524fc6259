#include <sidestep/runtime/planning_settings.hpp>

#include <algorithm>
#include <cmath>

#include <sidestep/core/index.hpp>
#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/entry_reading.hpp>

namespace sidestep {
namespace {

constexpr double kMaxIntervals = 9'999.0;

std::string one_of(std::string_view name, const std::vector<std::string>& candidates) {
  return did_you_mean(name, candidates, "there are: " + joined(candidates, " "));
}

/// A configuration while it is read: the values, and the node that gave each of them.
struct PartialState {
  Eigen::VectorXd q;
  std::vector<const Node*> origin;  ///< Null for a joint that nothing has given yet.

  void set(std::size_t joint, double value, const Node& node) {
    q[static_cast<Eigen::Index>(joint)] = value;
    origin[joint] = &node;
  }
  /// One mistake, one error: what an unreadable part would have given is not missing.
  void set_rest(const Node& node) {
    for (const Node*& of_joint : origin) of_joint = of_joint == nullptr ? &node : of_joint;
  }
};

void apply_pose(const Node& pose, const RobotDescription& robot, PartialState& state,
                std::vector<Error>& errors) {
  if (!pose.is_scalar()) {  // its schema told
    state.set_rest(pose);
    return;
  }
  const NamedPose* named = robot.find_pose(pose.text());
  if (named == nullptr) {
    errors.push_back(pose.error("robot '" + robot.name + "' has no pose '" + pose.text() + "'",
                                one_of(pose.text(), names_of(robot.poses))));
    state.set_rest(pose);
    return;
  }
  for (std::size_t j = 0; j < named->positions.size(); ++j) {
    if (named->positions[j]) state.set(j, *named->positions[j], pose);
  }
}

void apply_joints(const Node& joints, const RobotDescription& robot, PartialState& state,
                  std::vector<Error>& errors) {
  if (!joints.is_map()) {
    errors.push_back(
        joints.error("expected a map of joint names to values, found " + joints.kind()));
    state.set_rest(joints);
    return;
  }
  for (const Node::Entry& entry : joints.entries()) {
    const auto index = robot.joint_index(entry.key);
    if (!index) {
      errors.push_back(
          Error{ErrorCode::kConfig, "robot '" + robot.name + "' has no joint '" + entry.key + "'",
                entry.key_mark.to_string(), one_of(entry.key, names_of(robot.joints)), nullptr});
      continue;
    }
    const auto value = entry.value.as_double();
    if (!value) errors.push_back(value.error());
    const auto joint = static_cast<std::size_t>(*index);
    state.set(joint, value.value_or(robot.joints[joint].lower), entry.value);
  }
}

void require_name(const Node* name, const std::vector<std::string>& names, const std::string& what,
                  std::vector<Error>& errors) {
  if (name == nullptr || !name->is_scalar()) return;  // its schema told
  if (std::ranges::find(names, name->text()) != names.end()) return;
  errors.push_back(name->error("there is no " + what + " '" + name->text() + "'",
                               did_you_mean(name->text(), names)));
}

void check_limits(const RobotDescription& robot, const PartialState& state,
                  std::vector<Error>& errors) {
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const Joint& joint = robot.joints[j];
    const double value = state.q[static_cast<Eigen::Index>(j)];
    if (state.origin[j] == nullptr || (value >= joint.lower && value <= joint.upper)) continue;
    errors.push_back(state.origin[j]->error(
        "joint '" + joint.name + "' is at " + detail::number_text(value) + " " + joint.unit() +
        ", outside its limits [" + detail::number_text(joint.lower) + ", " +
        detail::number_text(joint.upper) + "]"));
  }
}

}  // namespace

Parameters<FloorEntry> FloorEntry::parameters() {
  using E = FloorEntry;
  return Parameters<E>()
      .add("height_m", static_cast<double E::*>(&Floor::height_m), "Its height in the world.",
           {.unit = "m", .min = -1e6, .max = 1e6})
      .add("except_links", static_cast<std::vector<std::string> E::*>(&Floor::except_links),
           "Links that it is not there for: those that stand on it, whose spheres reach into it.");
}

Parameters<PlanningSettings> PlanningSettings::parameters() {
  using S = PlanningSettings;
  const ParameterOptions space{.required = true, .choices = {"free", "occupied"}};
  return Parameters<S>()
      .add("unknown", &S::unknown, "What space that no frame has seen counts as.", space)
      .add("outside", &S::outside, "What space outside the map counts as.", space)
      .add(
          "floor", &S::floor,
          "The plane that the robot stands on, which maps leave out (`floor_clearance_m`): "
          "everything below is occupied, inside the map and outside it. Left out in a `plan`, "
          "`replan` or `deploy` experiment: for a robot with a driving base the floor at height 0, "
          "except for the links whose height no planned joint changes; give a `height_m` far below "
          "to have none. Robots without one, and the other experiments, which pose the problems of "
          "others, have no floor but the one that is given.")
      .add("max_unknown_share", &S::max_unknown_share,
           "Largest share of the checks of any link's spheres that may lie in space that no frame "
           "has seen or outside the map; a plan above it fails.",
           {.min = 0.0, .max = 1.0})
      .add("dt_s", &S::dt_s, "Time between support states.",
           {.unit = "s", .min = 1e-3, .max = 60.0})
      .add("speed_fraction", &S::speed_fraction,
           "Share of the velocity limits that a plan may use.", {.min = 0.01, .max = 1.0})
      .add(
          "acceleration_fraction", &S::acceleration_fraction,
          "Share of the acceleration limits that a plan may use, and of the limits of braking that "
          "stops may.",
          {.min = 0.01, .max = 1.0})
      .add(
          "assumed_ramp_s", &S::assumed_ramp_s,
          "A joint whose acceleration limit is not known is taken to have the one that reaches its "
          "velocity limit in this time.",
          {.unit = "s", .min = 1e-3, .max = 60.0})
      .add("duration_s", &S::duration_s,
           "Duration of the motion that is optimised; if absent, from the limits.",
           {.unit = "s", .min = 1e-3, .max = 3600.0})
      .add(
          "duration_scale", &S::duration_scale,
          "Duration of the motion that is optimised, where `duration_s` does not give it: relative "
          "to the least time in which each joint by itself could go from rest at the start to "
          "rest at the goal, within the limits of velocity and acceleration. Room to go around.",
          {.min = 1.0, .max = 100.0})
      .add("retime", &S::retime,
           "Time the path that the optimiser found anew, as fast as the limits of velocity and "
           "acceleration allow, before it is checked.")
      .add("qc", &S::qc, "Power spectral density of the GP prior, for every joint.",
           {.min = 1e-9, .max = 1e9})
      .add("interpolated_checks", &S::interpolated_checks,
           "States between each two support states at which obstacle costs apply.",
           {.min = 0, .max = 100})
      .add("collision_margin_m", &S::collision_margin_m,
           "Least distance between spheres and obstacles, or the floor: sampling planners keep it, "
           "the costs of trajectory optimisers begin no nearer.",
           {.unit = "m", .min = 0.0, .max = 10.0})
      .add("time_limit_s", &S::time_limit_s, "Time for one solve.", {.unit = "s", .min = 1e-3})
      .add("attempts", &S::attempts,
           "How often to try from another first guess when a plan does not pass its checks.",
           {.min = 1, .max = 100})
      .add("epsilon_m", &S::epsilon_m,
           "Obstacle and floor cost begin at this distance from a sphere.",
           {.unit = "m", .min = 0.0})
      .add("sigma_obstacle", &S::sigma_obstacle,
           "Standard deviation of the costs of obstacles, the floor and what moves.",
           {.unit = "m", .min = 1e-9})
      .add(
          "epsilon_moving_m", &S::epsilon_moving_m,
          "Cost of what is predicted to move begins at this distance from a sphere, no nearer than "
          "replanner.prediction_margin_m; 0 leaves it out.",
          {.unit = "m", .min = 0.0, .max = 10.0})
      .add("self_collision_epsilon_m", &S::self_collision_epsilon_m,
           "Self-collision cost begins at this distance between spheres.",
           {.unit = "m", .min = 0.0})
      .add("sigma_self_collision", &S::sigma_self_collision,
           "Standard deviation of the self-collision cost; 0 leaves it out.",
           {.unit = "m", .min = 0.0})
      .add("self_collision_placement", &S::self_collision_states,
           "States at which the self-collision cost applies.",
           {.choices = {"support", "support_and_interpolated"}})
      .add("sigma_position_limit", &S::sigma_position_limit,
           "Standard deviation of the joint limit cost (m, rad); 0 leaves it out.", {.min = 0.0})
      .add("position_limit_margin", &S::position_limit_margin,
           "Joint limit cost begins this far inside the limits (m, rad).", {.min = 0.0})
      .add("sigma_velocity_limit", &S::sigma_velocity_limit,
           "Standard deviation of the velocity limit cost (m/s, rad/s); 0 leaves it out.",
           {.min = 0.0})
      .add("sigma_sideways_mps", &S::sigma_sideways_mps,
           "Standard deviation of the speed of a differential base across its wheels; 0 leaves it "
           "out.",
           {.unit = "m/s", .min = 0.0})
      .add("sigma_endpoint", &S::sigma_endpoint, "Standard deviation of start and goal.",
           {.min = 1e-9});
}

SpacePolicy PlanningSettings::space() const {
  const auto space = [](const std::string& text) {
    return text == "free" ? Space::kFree : Space::kOccupied;
  };
  return {space(unknown), space(outside), floor};
}

MotionLimits PlanningSettings::limits(const RobotDescription& robot) const {
  return motion_limits(robot, {.speed_fraction = speed_fraction,
                               .acceleration_fraction = acceleration_fraction,
                               .assumed_ramp_s = assumed_ramp_s});
}

Parameters<CheckSettings> CheckSettings::parameters() {
  using S = CheckSettings;
  return Parameters<S>()
      .add("margin_m", &S::margin_m, "Clearance that the robot's spheres must keep in the field.",
           {.unit = "m", .min = 0.0, .max = 10.0})
      .add("max_step_m", &S::max_step_m, "First spacing of checks in the field, as sphere motion.",
           {.unit = "m", .min = 1e-4, .max = 1.0})
      .add("shape_max_step_m", &S::shape_max_step_m,
           "Largest motion of any point of the robot between independent checks.",
           {.unit = "m", .min = 1e-4, .max = 1.0})
      .add("speed_fraction", &S::speed_fraction,
           "Share of the velocity limits that must hold; planning aims for a smaller one, since "
           "its costs are soft.",
           {.min = 0.01, .max = 1.0})
      .add("acceleration_fraction", &S::acceleration_fraction,
           "Share of the acceleration limits that must hold, where they are known.",
           {.min = 0.01, .max = 1.0})
      .add("allowed_contacts", &S::allowed_contacts,
           "Links that may touch an object of the true scene, as a robot's foot the floor that it "
           "stands on; where the scene is not known they say nothing.")
      .add("certificate", &S::certificate,
           "Whether each plan that passes, and each motion that a closed loop follows, leaves a "
           "certificate, for sidestep_recheck: `file` in the run's folder `certificates`.",
           {.choices = {"none", "file"}});
}

Parameters<AllowedContactEntry> AllowedContactEntry::parameters() {
  using E = AllowedContactEntry;
  return Parameters<E>()
      .add("link", &E::link, "A link of the robot.", {.required = true})
      .add("object", &E::object, "An object of the scene.", {.required = true});
}

FieldCheckSettings CheckSettings::of_field() const {
  return {.margin_m = margin_m,
          .max_step_m = max_step_m,
          .speed_fraction = speed_fraction,
          .acceleration_fraction = acceleration_fraction};
}

ShapeCheckSettings CheckSettings::of_shapes() const {
  return {.max_step_m = shape_max_step_m,
          .speed_fraction = speed_fraction,
          .acceleration_fraction = acceleration_fraction};
}

void check_floor(const Node& planning, const RobotDescription& robot, std::vector<Error>& errors) {
  const Node* floor = planning.find("floor");
  const Node* names = floor != nullptr ? floor->find("except_links") : nullptr;
  if (names == nullptr) return;
  const std::vector<std::string> links = names_of(robot.links);
  for (const Node& name : names->items()) require_name(&name, links, "link", errors);
}

void check_allowed_contacts(const Node& check, const RobotDescription& robot, const Scene* scene,
                            std::vector<Error>& errors) {
  const std::vector<std::string> links = names_of(robot.links);
  std::vector<std::string> objects;
  if (scene != nullptr) {
    for (const SceneObject& object : scene->objects()) objects.push_back(object.name);
  }
  const Node* contacts = check.find("allowed_contacts");
  if (contacts == nullptr) return;
  for (const Node& contact : contacts->items()) {
    require_name(contact.find("link"), links, "link", errors);
    if (scene == nullptr) continue;
    require_name(contact.find("object"), objects, "object in the scene", errors);
  }
}

Parameters<RobotStateEntry> RobotStateEntry::parameters() {
  using S = RobotStateEntry;
  return Parameters<S>()
      .add("pose", &S::pose, "A named pose of the robot.")
      .add("joints", &S::joints,
           "Positions by joint name (m, rad): what the pose leaves open, or overrides of it.");
}

Problem make_problem(std::shared_ptr<const RobotModel> robot,
                     std::shared_ptr<const DistanceField> field, const PlanningSettings& settings,
                     const Eigen::VectorXd& q_start, const Eigen::VectorXd& q_goal,
                     double time_scale) {
  return make_problem(std::move(robot), std::move(field), settings,
                      RobotState{q_start, Eigen::VectorXd::Zero(q_start.size())}, q_goal,
                      time_scale);
}

Problem make_problem(std::shared_ptr<const RobotModel> robot,
                     std::shared_ptr<const DistanceField> field, const PlanningSettings& settings,
                     const RobotState& start, const Eigen::VectorXd& q_goal, double time_scale) {
  const Eigen::VectorXd& q_start = start.q;
  const Eigen::VectorXd at_rest = Eigen::VectorXd::Zero(q_start.size());
  const auto row = [](const Eigen::VectorXd& q) { return as_span(q); };
  const MotionLimits limits = settings.limits(robot->description());
  double braking_s = 0.0;
  for (std::size_t j = 0; j < limits.acceleration.size(); ++j) {
    const double speed = std::abs(start.qdot[static_cast<Eigen::Index>(j)]);
    if (limits.acceleration[j] > 0.0) {
      braking_s = std::max(braking_s, speed / limits.acceleration[j]);
    }
  }
  const double duration_s = settings.duration_s.value_or(
      settings.duration_scale * least_time_s(limits, row(q_start), row(q_goal)) + braking_s);
  const double intervals = std::ceil(time_scale * duration_s / settings.dt_s - 1e-9);
  Problem problem;
  problem.robot = std::move(robot);
  problem.field = std::move(field);
  problem.space = settings.space();
  problem.collision_margin_m = settings.collision_margin_m;
  problem.start = start;
  problem.goal = {q_goal, at_rest};
  problem.support_states = static_cast<int>(std::clamp(intervals, 2.0, kMaxIntervals)) + 1;
  problem.dt_s = settings.dt_s;
  problem.qc = Eigen::VectorXd::Constant(q_start.size(), settings.qc);
  problem.interpolated_checks = settings.interpolated_checks;
  problem.speed_fraction = settings.speed_fraction;
  CostSettings costs = settings;
  costs.self_collision_placement = settings.self_collision_states == "support"
                                       ? Placement::kSupport
                                       : Placement::kSupportAndInterpolated;
  problem.terms = standard_terms(problem, costs);
  return problem;
}

Eigen::VectorXd read_robot_state(const Node& block, const RobotDescription& robot,
                                 std::vector<Error>& errors, const Eigen::VectorXd* otherwise) {
  PartialState state{otherwise != nullptr ? *otherwise : Eigen::VectorXd::Zero(robot.dof()),
                     std::vector<const Node*>(robot.joints.size(), nullptr)};
  if (const Node* pose = block.find("pose"); pose != nullptr && !pose->is_null()) {
    apply_pose(*pose, robot, state, errors);
  }
  const std::size_t before = errors.size();
  if (const Node* joints = block.find("joints"); joints != nullptr && !joints->is_null()) {
    apply_joints(*joints, robot, state, errors);
  }
  std::string missing;
  for (std::size_t j = 0; j < state.origin.size() && otherwise == nullptr; ++j) {
    if (state.origin[j] != nullptr) continue;
    missing += (missing.empty() ? "'" : ", '") + robot.joints[j].name + "'";
  }
  // A misspelt joint is the likeliest reason for a missing one: reported once is enough.
  if (!missing.empty() && errors.size() == before) {
    errors.push_back(block.error("the state says nothing of " + missing,
                                 "give every joint a value in `joints`, or name a pose that does"));
  }
  check_limits(robot, state, errors);
  return state.q;
}

}  // namespace sidestep
