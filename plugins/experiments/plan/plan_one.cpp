#include <cmath>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/runtime/motion_planning.hpp>
#include <sidestep/runtime/shape_check.hpp>
#include <sidestep/runtime/standing_floor.hpp>
#include "plan_parts.hpp"

namespace sidestep {
namespace {

constexpr double kSlowerEachAttempt = 1.25;

/// Whether any link goes through more than it may of where nobody looked; empty if not.
std::string unseen_problem(const PlanningContext& context, const Verdict& verdict) {
  const double most = context.planning.max_unknown_share;
  if (verdict.most_unknown_share <= most) return "";
  return verdict.most_unknown_link + " is in space that no frame has seen or outside the map in " +
         format("%.1f %%", 100.0 * verdict.most_unknown_share) +
         " of its checks, and planning.max_unknown_share is " + format("%.1f %%", 100.0 * most) +
         ": look there first (map more frames), or raise it";
}

/// Runs the checks on the record's trajectory and states the first reason to refuse it.
Result<void> check_plan(const PlanningContext& context, PlanRecord& plan,
                        const Deadline& deadline) {
  const auto apply = [&](const ValidityCheck* check, std::optional<Verdict>& into,
                         const std::string& where) -> Result<void> {
    if (check == nullptr) return {};
    auto verdict = SIDESTEP_TRY(check->check(plan.solution.trajectory, 0.0, deadline));
    if (!verdict.valid() && plan.reason.empty()) plan.reason = where + verdict.describe();
    into = std::move(verdict);
    return {};
  };
  SIDESTEP_TRY(apply(context.field_check.get(), plan.field_verdict, "in the field, "));
  SIDESTEP_TRY(apply(context.voxel_check.get(), plan.voxel_verdict, "among the occupied voxels, "));
  SIDESTEP_TRY(apply(context.scene_check.get(), plan.scene_verdict, "in the true scene, "));
  if (plan.reason.empty() && !(plan.min_clearance_m().value_or(0.0) > 0.0)) {
    plan.reason = "the robot touches an obstacle";
  }
  if (plan.reason.empty()) plan.reason = unseen_problem(context, *plan.field_verdict);
  return {};
}

/// Keeps what holds a plan; one that cannot be explained is no worse for it.
void take_explanation(Result<Explanation> explanation, PlanRecord& plan, Log& log) {
  if (explanation) {
    plan.solution.explanation = std::move(*explanation);
  } else {
    log.warn("plan '" + plan.name + "' cannot be explained: " + explanation.error().describe());
  }
}

void tell_hindrances(const PlanRecord& plan, Log& log) {
  if (!plan.solution.explanation) return;
  const std::string times = plan.retiming ? " (times as optimised): " : ": ";
  for (const Hindrance& hindrance : plan.solution.explanation->hindrances) {
    log.warn("plan '" + plan.name + "' is held" + times + hindrance.describe());
  }
}

/// One attempt: pose the problem, solve it, check the solution.
Result<void> attempt_plan(const PlanningContext& context, const PluginPtr<Optimiser>& optimiser,
                          std::uint64_t seed, PlanRecord& plan, Log& log, std::stop_token stop) {
  const int attempt = plan.attempts++;
  PlanningSettings planning = context.planning;
  planning.hold_goal = !plan.task.frees_goal;
  Problem problem = make_problem(context.robot, context.field, planning, plan.q_start, plan.q_goal,
                                 std::pow(kSlowerEachAttempt, attempt));
  problem.terms.insert(problem.terms.end(), plan.task.terms.begin(), plan.task.terms.end());
  if (auto sound = problem.validate(); !sound) {
    plan.reason = "the problem makes no sense: " + sound.error().describe();
    return {};
  }
  const double spent_ms = plan.solution.solve_ms;
  const MotionLimits limits = context.planning.limits(context.robot->description());
  auto planned = SIDESTEP_TRY(plan_motion(optimiser, problem, initial_guess(problem, attempt, seed),
                                          {.limits = context.planning.retime ? &limits : nullptr},
                                          Deadline::after_s(context.planning.time_limit_s, stop)));
  plan.solution = std::move(planned.solution);
  plan.solution.solve_ms += spent_ms;
  plan.field_verdict = plan.voxel_verdict = plan.scene_verdict = std::nullopt;
  plan.retiming.reset();
  plan.reason = std::move(planned.failure);
  if (!plan.has_trajectory()) return {};
  const Trajectory optimised = plan.solution.trajectory;
  if (planned.deviation) {
    plan.retiming = RetimingRecord{optimised.duration_s(), *planned.deviation, planned.retime_ms};
  }
  if (planned.trajectory.size() > 0) {
    plan.solution.trajectory = std::move(planned.trajectory);
    SIDESTEP_TRY(check_plan(context, plan, Deadline(stop)));
  }
  if (!plan.success() || plan.solution.status != SolveStatus::kConverged) {
    take_explanation(explain(problem, optimised), plan, log);
  }
  return {};
}

}  // namespace

Result<PlanningContext> make_planning_context(std::shared_ptr<const RobotModel> robot,
                                              std::shared_ptr<const DistanceField> field,
                                              const OccupancyView& occupancy,
                                              std::shared_ptr<const Scene> scene,
                                              double scene_time_s, const PlanningSettings& planning,
                                              const CheckSettings& check) {
  PlanningContext context{std::move(robot), std::move(field), occupancy, planning, check};
  stand_on_floor(context.planning, *context.robot);
  context.field_check =
      make_field_check(context.robot, context.field, context.planning.space(), check.of_field());
  ShapeCheckSettings shapes = check.of_shapes();
  ShapeObstacles voxels;
  voxels.resolution_m = occupancy.occupancy_grid().resolution_m;
  voxels.occupied_centres_m = occupied_centres(occupancy);
  if (context.planning.floor) voxels.floor = *context.planning.floor;
  context.obstacles = voxels;
  context.voxel_check = SIDESTEP_TRY(make_shape_check(context.robot, std::move(voxels), shapes));
  if (!scene) return context;
  context.obstacles.scene = scene;
  ShapeObstacles truth;
  truth.scene = std::move(scene);
  truth.scene_time_s = scene_time_s;
  for (const AllowedContactEntry& contact : check.allowed_contacts) {
    const bool is_here = context.robot->description().link_index(contact.link).has_value();
    if (is_here) shapes.allowed_contacts.push_back(contact);  // else attached in another plan
  }
  context.allowed = shapes.allowed_contacts;
  context.scene_check = SIDESTEP_TRY(make_shape_check(context.robot, std::move(truth), shapes));
  return context;
}

Result<PlanRecord> make_plan(const PlanningContext& context, const PluginPtr<Optimiser>& optimiser,
                             PlanRecord plan, std::uint64_t seed, Log& log, std::stop_token stop) {
  if (const auto below = target_below_floor(plan.task, context.planning.floor); !below.empty()) {
    plan.reason = "the goal is not valid: " + below;
    return plan;
  }
  const auto refused = [&](const Eigen::VectorXd& q, const std::string& what) {
    const auto violation = state_violation(context.robot, context.field, context.planning.space(),
                                           context.check.margin_m, as_span(q));
    if (!violation) return false;
    plan.reason = what + ": " + violation->what();
    const Problem problem =
        make_problem(context.robot, context.field, context.planning, plan.q_start, plan.q_goal);
    take_explanation(explain_state(problem, as_span(q)), plan, log);
    tell_hindrances(plan, log);
    return true;
  };
  if (refused(plan.q_start, "the start is not valid")) return plan;
  if (!plan.task.frees_goal && refused(plan.q_goal, "the goal is not valid")) return plan;
  const std::uint64_t plan_seed = derive_seed(seed, "plan/" + plan.name);
  do {
    if (auto done = attempt_plan(context, optimiser, plan_seed, plan, log, stop); !done) {
      if (!stop.stop_requested()) return error_of(done);
    }
    if (stop.stop_requested()) {
      plan.interrupted = true;
      if (plan.reason.empty()) plan.reason = "interrupted";
      return plan;
    }
    if (!plan.success()) {
      log.warn("plan '" + plan.name + "', attempt " + std::to_string(plan.attempts) + " of " +
               std::to_string(context.planning.attempts) + ": " + plan.reason);
    }
    tell_hindrances(plan, log);
  } while (!plan.success() && plan.attempts < context.planning.attempts);
  return plan;
}

}  // namespace sidestep
