#include "deploy_settings.hpp"

#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/entry_reading.hpp>

namespace sidestep {
namespace {

/// What a request may say.
struct GoalEntry {
  RobotStateEntry goal;
  std::optional<EndEffectorEntry> end_effector;
  std::vector<OrientationCostEntry> orientation_costs;
  std::vector<AxisCostEntry> axis_costs;
  std::optional<PostureCostEntry> posture_cost;

  static Parameters<GoalEntry> parameters() {
    using E = GoalEntry;
    return Parameters<E>()
        .add("goal", &E::goal, "Where the robot is to be; joints left out stay as they are.")
        .add("end_effector", &E::end_effector, "Where a link is to be at the end.")
        .add("orientation_costs", &E::orientation_costs,
             "Links that are to keep an orientation along the way.")
        .add("axis_costs", &E::axis_costs,
             "Links of which an axis is to keep a direction along the way.")
        .add("posture_cost", &E::posture_cost, "A posture that is preferred along the way.");
  }
};

Error all_in_one(const std::string& id, const std::vector<Error>& errors) {
  std::string all;
  for (const Error& error : errors) all += (all.empty() ? "" : "; ") + error.describe();
  return {ErrorCode::kInvalidArgument, std::move(all), "goal " + id, {}, nullptr};
}

}  // namespace

DeployConfiguration read_deploy_configuration(const Configuration& configuration,
                                              const RobotDescription& robot,
                                              std::vector<Error>& errors) {
  DeployConfiguration read;
  read_loop_blocks(configuration, read.loop, errors);
  const Node& experiment = block_of(configuration, "experiment");
  if (!read_entry(experiment, read.deploy)) return read;
  read.loop.experiment = read.deploy;
  read.loop.q_start = read_robot_state(*experiment.find("start"), robot, errors);
  read.loop.q_goal = read.loop.q_start;
  return read;
}

Result<Goal> read_goal(const GoalRequest& request, const std::shared_ptr<const RobotModel>& robot,
                       const Eigen::VectorXd& q_now) {
  Goal goal;
  goal.id = request.id;
  goal.is_stop = request.wish.is_null();
  if (goal.is_stop) return goal;
  std::vector<Error> errors;
  check_against_schema(request.wish, GoalEntry::parameters().schema(), {}, errors);
  if (!errors.empty()) return tl::make_unexpected(all_in_one(request.id, errors));
  goal.q = q_now;
  if (const Node* state = request.wish.find("goal"); state != nullptr && state->is_map()) {
    goal.q = read_robot_state(*state, robot->description(), errors, &q_now);
  }
  goal.task = read_task(request.wish, robot, errors);
  if (!errors.empty()) return tl::make_unexpected(all_in_one(request.id, errors));
  return goal;
}

Parameters<DeploySettings> DeploySettings::parameters() {
  using S = DeploySettings;
  return experiment_parameters<S>()
      .add("clock", &S::clock,
           "wall: real time, mapping in a thread of its own; lockstep: simulated time in steps.",
           {.choices = {"lockstep", "wall"}})
      .add("goals", &S::goals,
           "Ends after so many; 0: when no more can come, or on Ctrl-C, which brings the robot to "
           "rest.",
           {.min = 0, .max = 1e6})
      .add("duration_s", &S::duration_s, "Most time for one goal; the robot then stops.",
           {.unit = "s", .min = 0.01, .max = 86400.0})
      .add("step_s", &S::step_s, "Longest time between two steps of the planning loop.",
           {.unit = "s", .min = 1e-4, .max = 0.01})
      .add("feedback_period_s", &S::feedback_period_s,
           "How often whoever asked hears how far there is to go.",
           {.unit = "s", .min = 0.01, .max = 60.0})
      .add("latency", &S::latency,
           "What computing is charged with in lockstep; planning with replanner.takeover_s.")
      .add("start", &S::start,
           "Where the robot starts, for an executor that can be told; a real one knows better.",
           {.required = true})
      .add("pictures", &S::pictures, "Pictures from above of the way to a goal.",
           {.min = 0, .max = 24});
}

}  // namespace sidestep
