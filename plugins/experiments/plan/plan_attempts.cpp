#include <cmath>

#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/planning/inverse_kinematics.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include <sidestep/runtime/motion_planning.hpp>

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

/// Makes one plan, attempt by attempt.
class PlanAttempts {
 public:
  PlanAttempts(const PlanningContext& context, const Planners& planners, std::uint64_t seed,
               Log& log, std::stop_token stop, PlanRecord& plan)
      : context_(context),
        planners_(planners),
        seed_(derive_seed(seed, "plan/" + plan.name)),
        log_(log),
        stop_(std::move(stop)),
        plan_(plan) {}

  /// A plan that fails is a record with a reason; an error is a fault of the optimiser's or of a
  /// check's.
  Result<void> run() {
    if (is_refused()) return {};
    const int most = context_.planning.attempts + (planners_.sampler ? kSampled : 0);
    do {
      if (auto done = attempt(); !done) {
        if (!stop_.stop_requested()) return done;
      }
      if (stop_.stop_requested()) {
        plan_.interrupted = true;
        if (plan_.reason.empty()) plan_.reason = "interrupted";
        return {};
      }
      if (!plan_.success()) {
        log_.warn("plan '" + plan_.name + "', attempt " + std::to_string(plan_.attempts) + " of " +
                  std::to_string(most) + ": " + plan_.reason);
      }
      tell_hindrances(plan_, log_);
    } while (!plan_.success() && plan_.attempts < most);
    if (!plan_.success() && plan_.task.frees_goal) tell_unreachable();
    return {};
  }

 private:
  static constexpr int kSampled = 2;  ///< Attempts that a sampler has.

  /// Where start or goal cannot be.
  bool is_refused() {
    if (auto below = target_below_floor(plan_.task, context_.planning.floor); !below.empty()) {
      plan_.reason = "the goal is not valid: " + below;
      return true;
    }
    if (is_blocked(plan_.q_start, "the start is not valid")) return true;
    return !plan_.task.frees_goal && is_blocked(plan_.q_goal, "the goal is not valid");
  }

  bool is_blocked(const Eigen::VectorXd& q, const std::string& what) {
    const auto violation = violation_at(as_span(q));
    if (!violation) return false;
    plan_.reason = what + ": " + violation->what();
    take_explanation(explain_state(posed(plan_.q_goal), as_span(q)), plan_, log_);
    tell_hindrances(plan_, log_);
    return true;
  }

  [[nodiscard]] std::optional<Violation> violation_at(std::span<const double> q) const {
    return state_violation(context_.robot, context_.field, context_.planning.space(),
                           context_.check.margin_m, q);
  }

  [[nodiscard]] Deadline time_limit() const {
    return Deadline::after_s(context_.planning.time_limit_s, stop_);
  }

  [[nodiscard]] Problem posed(const Eigen::VectorXd& q_goal) const {
    PlanningSettings planning = context_.planning;
    planning.hold_goal = !plan_.task.frees_goal;
    Problem problem =
        make_problem(context_.robot, context_.field, planning, plan_.q_start, q_goal, time_scale_);
    problem.terms.insert(problem.terms.end(), plan_.task.terms.begin(), plan_.task.terms.end());
    return problem;
  }

  /// Poses the problem, solves it, checks the solution. The first guess is a straight line; then,
  /// where there is a sampler, its path, and that path is tried as it is; then lines to
  /// configurations that reach a free goal; then lines that are bent.
  Result<void> attempt() {
    const int attempt = plan_.attempts++;
    const bool is_sampled = planners_.sampler && attempt > 0 && attempt <= kSampled;
    const int line = planners_.sampler && attempt > kSampled ? attempt - kSampled : attempt;
    int bend = is_sampled ? 0 : line;
    Eigen::VectorXd q_goal = plan_.q_goal;
    const int given = plan_.q_goal == plan_.q_start ? 0 : 1;  // lines to where that begins
    if (plan_.task.frees_goal && line >= given && !goals().q.empty()) {
      const int number = is_sampled ? 0 : line - given;
      const int count = static_cast<int>(goals().q.size());
      q_goal = goals().q[idx(number % count)];
      bend = number / count;
    }
    time_scale_ = std::pow(kSlowerEachAttempt, attempt);
    const Problem problem = posed(q_goal);
    if (auto sound = problem.validate(); !sound) {
      plan_.reason = "the problem makes no sense: " + sound.error().describe();
      return {};
    }
    const Deadline deadline = time_limit();
    if (!is_sampled) {
      return solve(planners_.optimiser, problem, initial_guess(problem, bend, seed_), deadline);
    }
    if (attempt == kSampled) {
      return solve(planners_.sampler, problem, straight_line(problem), deadline);
    }
    return solve_from_sampled(problem, deadline);
  }

  Result<void> solve_from_sampled(const Problem& problem, const Deadline& deadline) {
    auto path = SIDESTEP_TRY(propose_motion(*planners_.sampler, plugin_of(planners_.sampler),
                                            problem, straight_line(problem), deadline));
    plan_.solution.solve_ms += path.solution.solve_ms;
    if (!path.failure.empty()) {
      forget_attempt();
      plan_.solution.trajectory = {};
      plan_.reason = "the sampler " + path.failure;
      return {};
    }
    const Trajectory& sampled = path.solution.trajectory;
    Eigen::VectorXd q_end = problem.goal.q;
    if (plan_.task.frees_goal) std::ranges::copy(sampled.q(sampled.size() - 1), q_end.begin());
    const Problem from_there = posed(q_end);
    return solve(planners_.optimiser, from_there,
                 refit(sampled, 0.0, from_there.support_states, from_there.dt_s), deadline);
  }

  /// What was found of the last one.
  void forget_attempt() {
    plan_.field_verdict = plan_.voxel_verdict = plan_.scene_verdict = std::nullopt;
    plan_.retiming.reset();
  }

  Result<void> solve(const PluginPtr<Optimiser>& optimiser, const Problem& problem,
                     const Trajectory& guess, const Deadline& deadline) {
    const double spent_ms = plan_.solution.solve_ms;
    const MotionLimits limits = context_.planning.limits(context_.robot->description());
    auto planned = SIDESTEP_TRY(
        plan_motion(optimiser, problem, guess,
                    {.limits = context_.planning.retime ? &limits : nullptr}, deadline));
    plan_.solution = std::move(planned.solution);
    plan_.solution.solve_ms += spent_ms;
    forget_attempt();
    plan_.reason = std::move(planned.failure);
    if (!plan_.has_trajectory()) return {};
    const Trajectory optimised = plan_.solution.trajectory;
    if (planned.deviation) {
      plan_.retiming =
          RetimingRecord{optimised.duration_s(), *planned.deviation, planned.retime_ms};
    }
    if (planned.trajectory.size() > 0) {
      plan_.solution.trajectory = std::move(planned.trajectory);
      SIDESTEP_TRY(check_plan(context_, plan_, Deadline(stop_)));
    }
    if (!plan_.success() || plan_.solution.status != SolveStatus::kConverged) {
      take_explanation(explain(problem, optimised), plan_, log_);
    }
    return {};
  }

  /// Configurations that reach a free goal.
  const GoalConfigurations& goals() {
    if (!goals_) {
      const auto blocked = [&](std::span<const double> q) -> std::string {
        const auto violation = violation_at(q);
        return violation ? "is not valid: " + violation->what() : "";
      };
      const Stopwatch watch;
      goals_ = find_goals(posed(plan_.q_goal), {}, seed_, blocked, time_limit());
      plan_.solution.solve_ms += watch.elapsed_ms();
    }
    return *goals_;
  }

  /// Adds to the reason how near the goal the robot can be, where it cannot be there.
  void tell_unreachable() {
    if (!goals().q.empty() || stop_.stop_requested()) return;
    const bool is_told = plan_.reason.find("the joints' limits none") != std::string::npos;
    if (!is_told) plan_.reason += "; " + goals().reason;
    const Eigen::VectorXd& nearest = goals().nearest;
    if (!plan_.task.target || nearest.size() == 0) return;
    if (goal_miss(posed(plan_.q_goal), as_span(nearest)).empty()) return;  // reached, but blocked
    const RobotDescription& robot = context_.robot->description();
    std::vector<Transform> poses(robot.links.size());
    Scratch scratch;
    context_.robot->link_poses(as_span(nearest), poses, scratch);
    const Transform& there = poses[idx(robot.link_index(plan_.task.target->link).value_or(0))];
    const auto numbers = [](const Eigen::Vector3d& v) {
      std::vector<std::string> texts;
      for (const double value : v)
        texts.push_back(format("%.4g", std::round(value * 1e4) / 1e4 + 0.0));
      return "[" + joined(texts, ", ") + "]";
    };
    plan_.reason += ": position_m: " + numbers(there.translation()) +
                    ", rpy_rad: " + numbers(rpy_of(there.linear()));
  }

  const PlanningContext& context_;
  const Planners& planners_;
  std::uint64_t seed_;
  Log& log_;
  std::stop_token stop_;
  PlanRecord& plan_;
  double time_scale_ = 1.0;  ///< Of the attempt.
  std::optional<GoalConfigurations> goals_;
};

}  // namespace

Result<void> make_plan(const PlanningContext& context, const Planners& planners, std::uint64_t seed,
                       Log& log, std::stop_token stop, PlanRecord& plan) {
  return PlanAttempts(context, planners, seed, log, std::move(stop), plan).run();
}

}  // namespace sidestep
