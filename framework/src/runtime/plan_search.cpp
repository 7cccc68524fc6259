#include "plan_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/planning/explain.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/runtime/call_plugin.hpp>
#include <sidestep/runtime/motion_planning.hpp>
#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/retime.hpp>
#include <sidestep/trajectory/splice.hpp>

namespace sidestep::detail {
namespace {

/// A proposal that starts within this of the takeover is moved there: optimisers hold their start
/// by a strong cost, not exactly. One farther off makes no sense.
constexpr double kStartTolerance = 0.01;  // m, rad
/// One that starts at another velocity may come from a planner that knows none.
constexpr double kStartVelocityTolerance = 0.01;  // m/s, rad/s
constexpr std::string_view kAfterStop = "after_stop";
constexpr std::string_view kRetimed = "retimed";
constexpr std::string_view kBasePath = "base_path";
constexpr int kStages = 200;   ///< Of a new motion's timing: within 1 % of the fastest.
constexpr int kMostBends = 8;  ///< Waves grow with each try; then they begin anew, with others.
/// Of the time until it is to set out, what a robot at rest may spend on a search: it need not stop
/// for anything meanwhile, but may have to step aside after it.
constexpr double kShareAtRest = 0.5;

double largest_difference(std::span<const double> a, std::span<const double> b) {
  double largest = 0.0;
  for (std::size_t j = 0; j < a.size(); ++j) largest = std::max(largest, std::abs(a[j] - b[j]));
  return largest;
}

void set_first_state(Trajectory& trajectory, const RobotState& state) {
  std::ranges::copy(as_span(state.q), trajectory.q(0).begin());
  std::ranges::copy(as_span(state.qdot), trajectory.qdot(0).begin());
}

/// The rest of a trajectory as a first guess of a problem.
Trajectory sampled_anew(const Problem& problem, const Trajectory& trajectory, double from_s) {
  Trajectory guess = refit(trajectory, from_s, problem.support_states, problem.dt_s);
  set_first_state(guess, problem.start);
  return guess;
}

/// When a motion that is blocked at `blocked_s` may be expected at its end, of which `rest_s` is
/// left there: nobody knows for how long it stays blocked. A long way round that comes hardly
/// nearer is not worth it.
double expected_arrival_s(double blocked_s, double rest_s) {
  constexpr double kBlockedRest = 3.0;
  return blocked_s + kBlockedRest * rest_s;
}

}  // namespace

double least_rest_s(const Trajectory& motion, double from_s, const MotionLimits& limits) {
  std::vector<double> q(idx(motion.dof));
  motion.sample(std::min(from_s, motion.duration_s()), q, {});
  return least_time_s(limits, q, motion.q(motion.size() - 1));
}

struct PlanSearch::Task {
  const Request& request;
  Departure departure = {};
  RobotState start = {};  ///< The end of its lead.
  Problem problem = {};
  bool is_posed_anew = false;  ///< Not as the request's departure has it.
  Deadline deadline = {};
  Stopwatch watch = {};
  SearchResult result = {};
  bool is_rest = false;      ///< The guess being tried is the rest of the departure's `unfinished`,
  bool is_at_speed = false;  ///< which is as fast there as the robot.
  std::string failure = {};  ///< Of that guess.
  double cost = 0.0;         ///< Of its solution, as the optimiser states it.
  /// A path that needs no optimiser where all else fails.
  std::optional<Trajectory> sampled = {};
  std::optional<BaseWays> ways = {};  ///< Once they are wanted.
  /// Of the plans that are not free all the way the one that arrives first, and its guess.
  std::optional<FoundPlan> stopgap = {};
  std::size_t stopgap_guess = 0;
};

PlanSearch::PlanSearch(const Replanner::Parts& parts, const ReplannerSettings& settings)
    : parts_(parts), settings_(settings) {
  for (const std::string& guess : settings.escalation) {
    if (std::ranges::find(kReplanGuesses, guess) != kReplanGuesses.end()) {
      counts_.push_back({guess, 0, 0});
    } else {
      parts.log.warn("no first guess is called '" + guess + "': passed over");
    }
  }
}

SearchResult PlanSearch::run(const Request& request) {
  Task task{request};
  const bool is_at_rest = request.departure.followed == nullptr;
  const double limit_s =
      std::max(settings_.solve_limit_s, is_at_rest ? kShareAtRest * settings_.takeover_s : 0.0);
  if (settings_.limit_wall_time) task.deadline = Deadline::after_s(limit_s);
  if (!depart(request.departure, task)) {
    task.result.failure = std::move(task.failure);
    return std::move(task.result);
  }
  for (const std::size_t guess : order(std::exchange(first_, 0))) {
    const bool is_late = !task.result.tried.empty() && task.deadline.expired();
    if (is_late) task.result.failure += "; there was no time for more";
    if (is_late || (task.stopgap && is_long_enough(task))) {
      first_ = guess;
      break;
    }
    attempt(guess, task);
    if (task.result.plan || !task.result.fault.empty()) break;
  }
  if (task.result.tried.empty()) task.result.failure = "there is no first guess to try";
  if (!task.result.plan && task.result.fault.empty() && task.stopgap) {
    task.result.plan = std::move(task.stopgap);
    task.result.guess = counts_[task.stopgap_guess].guess;
    ++counts_[task.stopgap_guess].led;
  }
  return std::move(task.result);
}

/// All guesses from one on. A stop stays the last resort.
std::vector<std::size_t> PlanSearch::order(std::size_t first) const {
  std::vector<std::size_t> guesses(counts_.size());
  std::iota(guesses.begin(), guesses.end(), std::size_t{0});
  if (first < counts_.size() && counts_[first].guess != kAfterStop) {
    std::rotate(guesses.begin(), guesses.begin() + static_cast<std::ptrdiff_t>(first),
                guesses.end());
  }
  std::stable_partition(guesses.begin(), guesses.end(),
                        [&](std::size_t i) { return counts_[i].guess != kAfterStop; });
  return guesses;
}

void PlanSearch::attempt(std::size_t guess, Task& task) {
  Replanner::GuessCount& count = counts_[guess];
  task.failure.clear();
  task.is_rest = count.guess == kRetimed;
  const auto initial = first_guess(count.guess, task);
  const bool is_tried = initial || !task.failure.empty() || !task.result.fault.empty();
  if (!is_tried) return;
  ++count.tried;
  task.result.tried.push_back(count.guess);
  if (initial) {
    auto proposal = count.guess == kRetimed
                        ? initial
                        : solve(parts_.optimiser, parts_.optimiser_name, *initial, task);
    if (proposal) task.result.plan = accept(std::move(*proposal), task);
    const bool is_left = !task.result.plan && task.result.fault.empty() && task.sampled;
    if (is_left && !task.departure.is_moving) {
      task.result.plan = accept(*task.sampled, task);
    }
  }
  const auto arrival_s = [](const FoundPlan& plan) {
    return expected_arrival_s(plan.free_until_s, plan.rest_s);
  };
  if (task.result.plan && std::isfinite(task.result.plan->free_until_s)) {
    if (!task.stopgap || arrival_s(*task.result.plan) < arrival_s(*task.stopgap)) {
      task.stopgap = std::move(task.result.plan);
      task.stopgap_guess = guess;
    }
    task.result.plan.reset();
  }
  if (task.result.plan) {
    ++count.led;
    task.result.guess = count.guess;
  } else if (!task.failure.empty()) {
    task.result.failure +=
        (task.result.failure.empty() ? "" : "; ") + count.guess + ": " + task.failure;
  }
}

/// Nothing, and no failure, where the guess does not fit the situation.
std::optional<Trajectory> PlanSearch::first_guess(std::string_view name, Task& task) {
  if (std::exchange(task.is_posed_anew, false) && !depart(task.request.departure, task)) {
    return std::nullopt;
  }
  if (name == kAfterStop && !depart_after_stop(task)) return std::nullopt;
  const Problem& problem = task.problem;
  task.sampled.reset();
  if (name == "refit" || name == kRetimed) {
    const Trajectory* rest = task.departure.unfinished;
    const double from_s = task.departure.unfinished_from_s;
    if (rest == nullptr || rest->duration_s() <= from_s) return std::nullopt;
    if (name == kRetimed) {
      if (!task.request.predicted) return std::nullopt;
      const double here_s = nearest_state(*rest, as_span(task.start.q)).time_s;
      if (here_s >= rest->duration_s()) return std::nullopt;
      Trajectory path = cut(*rest, here_s, rest->duration_s());
      task.is_at_speed =
          largest_difference(path.qdot(0), as_span(task.start.qdot)) <= kStartVelocityTolerance;
      set_first_state(path, task.start);
      return path;
    }
    return sampled_anew(problem, *rest, from_s);
  }
  if (name == "perturbed") {
    // A bend by chance is sooner now and then where nothing has changed.
    if (task.request.to_end_before_s && !task.request.predicted) return std::nullopt;
    const int bend = bends_++;
    return initial_guess(problem, 1 + bend % kMostBends,
                         settings_.seed + static_cast<std::uint64_t>(bend / kMostBends));
  }
  if (name == kBasePath) {
    if (!parts_.robot->description().planar_base()) return std::nullopt;
    if (task.request.to_beat) return std::nullopt;  // of what is posed, in as much time
    if (base_ways(task).empty()) {
      task.failure = task.deadline.expired() ? "there was no time to find the base a way"
                                             : "it finds no way for the base";
      return std::nullopt;
    }
    task.sampled = base_ways(task).first_guess(problem);
    task.problem.support_states = task.sampled->size();
    task.is_posed_anew = true;
    return task.sampled;
  }
  const Trajectory line = straight_line(problem);
  if (name != "sampled") return line;
  if (parts_.sampler == nullptr) return std::nullopt;
  auto path = solve(*parts_.sampler, parts_.sampler_name, line, task);
  if (!path) return std::nullopt;
  task.sampled = std::move(*path);
  return sampled_anew(problem, *task.sampled, 0.0);
}

/// Poses the problem from the end of a lead; false, with the failure noted, where it makes no
/// sense.
bool PlanSearch::depart(Departure departure, Task& task) const {
  task.departure = std::move(departure);
  task.start = end_state(task.departure.lead);
  if (!task.departure.is_moving) task.start.qdot.setZero();
  task.problem = parts_.pose_problem(task.request.field, task.start, parts_.goal);
  if (const auto& predicted = task.request.predicted) {
    task.problem.prediction = predicted->prediction;
    task.problem.prediction_from_s = predicted->from_s + task.departure.lead.duration_s();
    task.problem.prediction_margin_m = settings_.prediction_margin_m;
    if (parts_.moving_costs) add_moving_term(*parts_.moving_costs, task.problem);
  }
  auto sound = task.problem.validate();
  if (!sound) task.failure = "the problem makes no sense: " + sound.error().describe();
  return sound.has_value();
}

/// Lets the stop come first: the new motion begins at its end, at rest.
bool PlanSearch::depart_after_stop(Task& task) const {
  if (!task.departure.is_moving || task.departure.followed == nullptr) return false;
  if (task.request.to_beat) return false;  // nothing worth a stop
  auto stop = brake(*task.departure.followed, task.departure.from_s, parts_.limits);
  if (!stop) return false;
  Departure departure = task.departure;
  departure.lead = joined(departure.lead, *stop);
  departure.followed = nullptr;
  departure.is_moving = false;
  task.is_posed_anew = true;
  return depart(std::move(departure), task);
}

/// By the wall's clock, whether a search need not go on for something better.
bool PlanSearch::is_long_enough(const Task& task) const {
  return settings_.limit_wall_time && 1e-3 * task.watch.elapsed_ms() > settings_.stopgap_after_s;
}

/// What the optimiser proposes; nothing where it does not, with the failure or the fault noted.
std::optional<Trajectory> PlanSearch::solve(Optimiser& optimiser, const std::string& name,
                                            const Trajectory& guess, Task& task) const {
  const double limit_s = task.deadline.remaining_s();
  const Stopwatch watch;
  auto proposal = propose_motion(optimiser, name, task.problem, guess, task.deadline);
  const double took_ms = watch.elapsed_ms();
  task.result.solve_ms += took_ms;
  const double grace_s = std::max(0.0, settings_.takeover_s - settings_.solve_limit_s);
  if (settings_.limit_wall_time && took_ms * 1e-3 > limit_s + grace_s) {
    task.result.fault = "plugin " + name + " took " + format("%.3f", took_ms * 1e-3) + " s of " +
                        format("%.3f s", limit_s) + " that it had";
    return std::nullopt;
  }
  if (!proposal) {
    const bool is_late = proposal.error().code == ErrorCode::kDeadlineExceeded;
    (is_late ? task.failure : task.result.fault) = proposal.error().describe();
    return std::nullopt;
  }
  Trajectory& trajectory = proposal->solution.trajectory;
  if (proposal->failure.empty()) proposal->failure = why_elsewhere(task, trajectory);
  if (!proposal->failure.empty()) {
    const bool is_fault = proposal->is_fault || trajectory.size() > 0;
    (is_fault ? task.result.fault : task.failure) = "plugin " + name + " " + proposal->failure;
    return std::nullopt;
  }
  task.cost = proposal->solution.cost;
  return std::move(trajectory);
}

/// How a proposal starts where the robot will not be; empty if it does not.
std::string PlanSearch::why_elsewhere(const Task& task, const Trajectory& proposal) const {
  const std::vector<Joint>& joints = parts_.robot->description().joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const double off = std::abs(proposal.q(0)[j] - task.start.q[static_cast<Eigen::Index>(j)]);
    if (off <= kStartTolerance) continue;
    return "returned a broken trajectory: it starts with joint '" + joints[j].name + "' " +
           format("%.4g", off) + (joints[j].type == Joint::Type::kPrismatic ? " m" : " rad") +
           " from where the robot will be";
  }
  return {};
}

/// The plan that a proposal makes; nothing, with the failure noted, where it is none.
std::optional<FoundPlan> PlanSearch::accept(Trajectory proposal, Task& task) const {
  auto plan = timed(std::move(proposal), task);
  if (plan) plan = checked(*std::move(plan), task);
  if (!plan || !parts_.objection) return plan;
  const std::string objection = parts_.objection(plan->trajectory);
  if (objection.empty()) return plan;
  task.failure = objection;
  return std::nullopt;
}

/// A proposal as fast as the limits allow, or as it was timed, among what is predicted.
std::optional<FoundPlan> PlanSearch::timed(Trajectory proposal, Task& task) const {
  const auto refuse = [&](std::string why) {
    task.failure = std::move(why);
    return std::nullopt;
  };
  const double off = largest_difference(proposal.qdot(0), as_span(task.start.qdot));
  if (off > kStartVelocityTolerance) {
    return refuse("it starts at a velocity that differs by " + format("%.3g", off));
  }
  const std::string miss = goal_miss(task.problem, proposal.q(proposal.size() - 1));
  if (!miss.empty()) return refuse("it ends with " + miss);
  FoundPlan plan;
  plan.cost = task.cost;
  set_first_state(proposal, task.start);
  const bool is_timed = settings_.timing == "planner" && ((task.is_rest && task.is_at_speed) ||
                                                          keeps_limits(proposal, parts_.limits));
  auto retimed =
      is_timed ? Result<Retiming>({proposal, 0.0})
               : retime(proposal, parts_.limits, {.least_stages = kStages, .stop_at_goal = true});
  if (!retimed) return refuse("it cannot be timed: " + retimed.error().describe());
  if (task.request.to_beat) {
    // Sampled as what is followed was: costs of unlike states do not compare.
    const auto explained =
        explain(task.problem, sampled_anew(task.problem, retimed->trajectory, 0.0));
    if (!explained) return refuse("it cannot be compared: " + explained.error().describe());
    plan.cost = explained->cost;
    if (!(plan.cost < *task.request.to_beat)) {
      return refuse("it is not better by enough: it costs " + format("%.4g", plan.cost));
    }
  }
  plan.splice_velocity_jump =
      largest_difference(retimed->trajectory.qdot(0), as_span(task.start.qdot));
  plan.takeover_s = task.departure.lead.duration_s();
  plan.trajectory = joined(task.departure.lead, retimed->trajectory);
  plan.is_rest = task.is_rest;
  plan.frees_goal = is_goal_free(task.problem);
  if (task.request.predicted) {
    auto among = among_predicted(plan, proposal, task.departure, task.request);
    if (!among) {
      task.result.refused = std::make_shared<const Trajectory>(std::move(plan.trajectory));
      task.result.refused_free_s.reset();
      return refuse("what is predicted leaves no time for it");
    }
    plan.delay_s = among->duration_s() - soonest_s(plan, task);
    if (among->times_s != plan.trajectory.times_s) plan.at_once = std::move(plan.trajectory);
    plan.trajectory = std::move(*among);
  }
  if (task.request.to_end_before_s &&
      plan.trajectory.duration_s() > *task.request.to_end_before_s) {
    return refuse("it is not sooner at the goal");
  }
  return plan;
}

/// A plan that nothing that moves could reach before a stop, and that is free of what stands, or
/// for long enough.
std::optional<FoundPlan> PlanSearch::checked(FoundPlan plan, Task& task) const {
  // Longer than what is followed must keep to, lest the robot brake for what it just set out by.
  const double brake_s = plan.takeover_s + settings_.replan_period_s + settings_.search_s();
  const auto reached =
      task.request.reach.first_reach(plan.trajectory, 0.0, brake_s, task.request.now);
  if (reached) {
    task.result.refused = std::make_shared<const Trajectory>(std::move(plan.trajectory));
    task.result.refused_free_s.reset();
    task.failure = "before it could stop " + *reached;
    return std::nullopt;
  }
  const auto verdict = task.request.check.check(plan.trajectory, 0.0, task.deadline);
  if (!verdict) {
    task.failure = "it cannot be checked: " + verdict.error().describe();
    return std::nullopt;
  }
  plan.unknown_share = verdict->unknown_share;
  if (verdict->valid()) return plan;
  plan.free_until_s = verdict->first_violation_s;
  plan.rest_s = rest_s(plan.trajectory, plan.free_until_s, task);
  task.failure = "it is " + verdict->describe();
  task.result.refused = std::make_shared<const Trajectory>(plan.trajectory);
  task.result.refused_free_s = plan.free_until_s;
  // What is in the way may go; a limit that is broken stays so.
  const bool may_go = std::ranges::all_of(verdict->violations, [](const Violation& violation) {
    return violation.kind == Violation::Kind::kCollision ||
           violation.kind == Violation::Kind::kUnproven;
  });
  const double arrival_s = expected_arrival_s(plan.free_until_s, plan.rest_s);
  const bool is_worth_it =
      plan.free_until_s >= task.request.least_free_s && arrival_s < to_arrive_before_s(task);
  return may_go && is_worth_it ? std::optional(std::move(plan)) : std::nullopt;
}

/// The ways of the base to the goal in the map that is searched in.
const BaseWays& PlanSearch::base_ways(Task& task) const {
  if (!task.ways) task.ways.emplace(task.problem, task.deadline);
  return *task.ways;
}

/// The least time from a motion's state at `from_s` to its end; where the base has to go around
/// something, around it.
double PlanSearch::rest_s(const Trajectory& motion, double from_s, Task& task) const {
  const double straight_s = least_rest_s(motion, from_s, parts_.limits);
  if (std::ranges::find(settings_.escalation, kBasePath) == settings_.escalation.end()) {
    return straight_s;
  }
  std::vector<double> q(idx(motion.dof));
  motion.sample(std::min(from_s, motion.duration_s()), q, {});
  const auto length_m = base_ways(task).length_m(q);
  const auto base = parts_.robot->description().planar_base();
  if (!length_m || !base) return straight_s;
  const double speed_mps =
      std::min(parts_.limits.velocity[idx((*base)[0])], parts_.limits.velocity[idx((*base)[1])]);
  return std::max(straight_s, *length_m / speed_mps);
}

/// When a plan that is not free all the way must be expected at its end, from now on, to be worth
/// more than what is followed.
double PlanSearch::to_arrive_before_s(Task& task) const {
  constexpr double kWorth_s = 1.0;
  const auto& blocked = task.request.blocked;
  if (!blocked) return std::numeric_limits<double>::infinity();
  const double left_s = rest_s(blocked->motion, blocked->begin_s, task);
  return expected_arrival_s(blocked->in_s, left_s) - kWorth_s;
}

/// The sooner of two motions that are clear of what is predicted: the plan, slowed down where it
/// has to be, and the proposal as it was timed by its planner, if that keeps the limits. Nothing
/// where neither is.
std::optional<Trajectory> PlanSearch::among_predicted(const FoundPlan& plan,
                                                      const Trajectory& proposal,
                                                      const Departure& departure,
                                                      const Request& request) const {
  auto slower = retime_among(plan.trajectory, plan.takeover_s, parts_.limits, *request.predicted,
                             request.prediction_check);
  if (!keeps_limits(proposal, parts_.limits)) return slower;
  Trajectory as_timed = joined(departure.lead, proposal);
  if (slower && slower->duration_s() <= as_timed.duration_s()) return slower;
  if (request.prediction_check.first_conflict(as_timed, 0.0, *request.predicted)) return slower;
  return as_timed;
}

/// How long a plan would last if nothing were to be waited for. A planner that times motions has
/// put its waits and detours into them: then it is the straight way at full speed.
double PlanSearch::soonest_s(const FoundPlan& plan, const Task& task) const {
  if (settings_.timing != "planner") return plan.trajectory.duration_s();
  MotionLimits at_once = parts_.limits;
  std::ranges::fill(at_once.acceleration, std::numeric_limits<double>::infinity());
  const auto goal = plan.trajectory.q(plan.trajectory.size() - 1);
  return plan.takeover_s + least_time_s(at_once, as_span(task.start.q), goal);
}

std::optional<double> PlanSearch::cost_of_rest(std::shared_ptr<const DistanceField> field,
                                               const Departure& departure) const {
  if (departure.followed == nullptr || departure.followed->duration_s() <= departure.from_s) {
    return std::nullopt;
  }
  const Problem problem =
      parts_.pose_problem(std::move(field), end_state(departure.lead), parts_.goal);
  if (!problem.validate()) return std::nullopt;
  const auto explained =
      explain(problem, sampled_anew(problem, *departure.followed, departure.from_s));
  if (!explained) return std::nullopt;
  return explained->cost;
}

}  // namespace sidestep::detail
