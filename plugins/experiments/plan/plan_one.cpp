#include "plan_one.hpp"

#include <cmath>

#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/report/text_table.hpp>
#include <sidestep/runtime/motion_planning.hpp>
#include <sidestep/runtime/shape_check.hpp>
#include <sidestep/runtime/standing_floor.hpp>

namespace sidestep {
namespace {

constexpr double kSlowerEachAttempt = 1.25;

/// What is wrong with being at `q`; empty if nothing is.
std::string state_problem(const PlanWorld& world, const Eigen::VectorXd& q,
                          const std::string& what) {
  const auto violation =
      state_violation(world.robot, world.field, world.planning.space(), world.margin_m, as_span(q));
  return violation ? what + ": " + violation->what() : "";
}

/// Whether any link goes through more than it may of where nobody looked; empty if not.
std::string unseen_problem(const PlanWorld& world, const Verdict& verdict) {
  const double most = world.planning.max_unknown_share;
  if (verdict.most_unknown_share <= most) return "";
  return verdict.most_unknown_link + " is in space that no frame has seen or outside the map in " +
         format("%.1f %%", 100.0 * verdict.most_unknown_share) +
         " of its checks, and planning.max_unknown_share is " + format("%.1f %%", 100.0 * most) +
         ": look there first (map more frames), or raise it";
}

/// Runs the checks on the record's trajectory and states the first reason to refuse it.
Result<void> check_plan(const PlanWorld& world, PlanRecord& plan, const Deadline& deadline) {
  const auto apply = [&](const ValidityCheck* check, std::optional<Verdict>& into,
                         const std::string& where) -> Result<void> {
    if (check == nullptr) return {};
    auto verdict = SIDESTEP_TRY(check->check(plan.solution.trajectory, 0.0, deadline));
    if (!verdict.valid() && plan.reason.empty()) plan.reason = where + verdict.describe();
    into = std::move(verdict);
    return {};
  };
  auto done = apply(world.in_snapshot.get(), plan.in_snapshot, "in the field, ");
  if (done) done = apply(world.in_voxels.get(), plan.in_voxels, "among the occupied voxels, ");
  if (done) done = apply(world.in_scene.get(), plan.in_scene, "in the true scene, ");
  if (done && plan.reason.empty() && !(plan.min_clearance_m().value_or(0.0) > 0.0)) {
    plan.reason = "the robot touches an obstacle";
  }
  if (done && plan.reason.empty()) plan.reason = unseen_problem(world, *plan.in_snapshot);
  return done;
}

/// Has it explained what holds the optimiser's own trajectory; a plan that cannot be explained is
/// no worse for it.
void explain_plan(const Problem& problem, const Trajectory& optimised, PlanRecord& plan, Log& log) {
  auto explanation = explain(problem, optimised);
  if (!explanation) {
    log.warn("plan '" + plan.name + "' cannot be explained: " + explanation.error().describe());
    return;
  }
  plan.solution.explanation = std::move(*explanation);
}

/// The same of a start or a goal that cannot be used.
void explain_endpoint(const PlanWorld& world, const Eigen::VectorXd& q, PlanRecord& plan,
                      Log& log) {
  const Problem problem =
      make_problem(world.robot, world.field, world.planning, plan.q_start, plan.q_goal);
  auto explanation = explain_state(problem, as_span(q));
  if (!explanation) {
    log.warn("plan '" + plan.name + "' cannot be explained: " + explanation.error().describe());
    return;
  }
  plan.solution.explanation = std::move(*explanation);
}

void tell_hindrances(const PlanRecord& plan, Log& log) {
  if (!plan.solution.explanation) return;
  const std::string times = plan.retiming ? " (times as optimised): " : ": ";
  for (const Hindrance& hindrance : plan.solution.explanation->hindrances) {
    log.warn("plan '" + plan.name + "' is held" + times + hindrance.describe());
  }
}

/// One attempt: pose the problem, solve it, check the solution.
Result<void> attempt_plan(const PlanWorld& world, const PluginPtr<Optimiser>& optimiser,
                          std::uint64_t seed, PlanRecord& plan, Log& log, std::stop_token stop) {
  const int attempt = plan.attempts++;
  PlanningSettings planning = world.planning;
  planning.hold_goal = !plan.task.frees_goal;
  Problem problem = make_problem(world.robot, world.field, planning, plan.q_start, plan.q_goal,
                                 std::pow(kSlowerEachAttempt, attempt));
  problem.terms.insert(problem.terms.end(), plan.task.terms.begin(), plan.task.terms.end());
  if (auto sound = problem.validate(); !sound) {
    plan.reason = "the problem makes no sense: " + sound.error().describe();
    return {};
  }
  const double spent_ms = plan.solution.solve_ms;
  const MotionLimits limits = world.planning.limits(world.robot->description());
  auto planned = SIDESTEP_TRY(plan_motion(optimiser, problem, initial_guess(problem, attempt, seed),
                                          {.limits = world.planning.retime ? &limits : nullptr},
                                          Deadline::after_s(world.planning.time_limit_s, stop)));
  plan.solution = std::move(planned.solution);
  plan.solution.solve_ms += spent_ms;
  plan.in_snapshot = plan.in_voxels = plan.in_scene = std::nullopt;
  plan.retiming.reset();
  plan.reason = std::move(planned.failure);
  if (!plan.has_trajectory()) return {};
  const Trajectory optimised = plan.solution.trajectory;
  if (planned.deviation) {
    plan.retiming = RetimingRecord{optimised.duration_s(), *planned.deviation, planned.retime_ms};
  }
  if (planned.trajectory.size() > 0) {
    plan.solution.trajectory = std::move(planned.trajectory);
    SIDESTEP_TRY(check_plan(world, plan, Deadline(stop)));
  }
  if (!plan.success() || plan.solution.status != SolveStatus::kConverged) {
    explain_plan(problem, optimised, plan, log);
  }
  return {};
}

}  // namespace

Result<PlanWorld> make_plan_world(std::shared_ptr<const RobotModel> robot,
                                  std::shared_ptr<const DistanceField> field,
                                  const OccupancyView& occupancy,
                                  std::shared_ptr<const Scene> scene, double scene_time_s,
                                  const PlanningSettings& planning, const CheckSettings& check) {
  PlanWorld world;
  world.planning = planning;
  stand_on_floor(world.planning, *robot);
  world.in_snapshot =
      make_field_check(robot, field, world.planning.space(),
                       FieldCheckSettings{.margin_m = check.margin_m,
                                          .max_step_m = check.max_step_m,
                                          .speed_fraction = check.speed_fraction,
                                          .acceleration_fraction = check.acceleration_fraction});
  const ShapeCheckSettings shapes{.max_step_m = check.shape_max_step_m,
                                  .speed_fraction = check.speed_fraction,
                                  .acceleration_fraction = check.acceleration_fraction};
  ShapeObstacles voxels;
  voxels.resolution_m = occupancy.occupancy_grid().resolution_m;
  voxels.occupied_centres_m = occupied_centres(occupancy);
  if (world.planning.floor) voxels.floor = *world.planning.floor;
  auto in_voxels = SIDESTEP_TRY(make_shape_check(robot, std::move(voxels), shapes));
  world.in_voxels = std::move(in_voxels);
  if (scene) {
    ShapeObstacles truth;
    truth.scene = std::move(scene);
    truth.scene_time_s = scene_time_s;
    ShapeCheckSettings touching = shapes;
    for (const AllowedContactEntry& contact : check.allowed_contacts) {
      const bool is_here = robot->description().link_index(contact.link).has_value();
      if (is_here) touching.allowed_contacts.push_back(contact);  // else attached in another plan
    }
    auto in_scene = SIDESTEP_TRY(make_shape_check(robot, std::move(truth), std::move(touching)));
    world.in_scene = std::move(in_scene);
  }
  world.robot = std::move(robot);
  world.field = std::move(field);
  world.margin_m = check.margin_m;
  return world;
}

Result<PlanRecord> make_plan(const PlanWorld& world, const PluginPtr<Optimiser>& optimiser,
                             PlanRecord plan, std::uint64_t seed, Log& log, std::stop_token stop) {
  if (const auto below = target_below_floor(plan.task, world.planning.floor); !below.empty()) {
    plan.reason = "the goal is not valid: " + below;
    return plan;
  }
  const auto refused = [&](const Eigen::VectorXd& q, const std::string& what) {
    plan.reason = state_problem(world, q, what);
    if (plan.reason.empty()) return false;
    explain_endpoint(world, q, plan, log);
    tell_hindrances(plan, log);
    return true;
  };
  if (refused(plan.q_start, "the start is not valid")) return plan;
  if (!plan.task.frees_goal && refused(plan.q_goal, "the goal is not valid")) return plan;
  const std::uint64_t plan_seed = derive_seed(seed, "plan/" + plan.name);
  do {
    if (auto done = attempt_plan(world, optimiser, plan_seed, plan, log, stop); !done) {
      if (!stop.stop_requested()) return error_of(done);
    }
    if (stop.stop_requested()) {
      plan.interrupted = true;
      if (plan.reason.empty()) plan.reason = "interrupted";
      return plan;
    }
    if (!plan.success()) {
      log.warn("plan '" + plan.name + "', attempt " + std::to_string(plan.attempts) + " of " +
               std::to_string(world.planning.attempts) + ": " + plan.reason);
    }
    tell_hindrances(plan, log);
  } while (!plan.success() && plan.attempts < world.planning.attempts);
  return plan;
}

}  // namespace sidestep
