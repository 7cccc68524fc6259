#include "ompl_optimiser.hpp"

#include <algorithm>
#include <atomic>
#include <limits>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include <ompl/base/OptimizationObjective.h>
#include <ompl/base/ProblemDefinition.h>
#include <ompl/base/goals/GoalStates.h>
#include <ompl/base/objectives/PathLengthOptimizationObjective.h>
#include <ompl/base/objectives/StateCostIntegralObjective.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/geometric/PathSimplifier.h>
#include <ompl/util/Exception.h>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "path_planner.hpp"
#include "planners.hpp"
#include "search.hpp"

namespace sidestep::ompl_optimiser {
namespace {

namespace ob = ::ompl::base;
namespace og = ::ompl::geometric;

using joint_paths::no_path;
using joint_paths::PathPlanner;

constexpr double kTieBreak = 1e-3;

class KeepingClear final : public ob::StateCostIntegralObjective {
 public:
  KeepingClear(const ob::SpaceInformationPtr& information, double share, const Options& options,
               const Problem& problem, const Search& search)
      : ob::StateCostIntegralObjective(information, true),
        share_(share),
        weight_(options.clearance_weight),
        clearance_m_(options.clearance_m),
        problem_(problem),
        search_(search),
        above_floor_(problem.space, problem.robot->description()),
        q_(search.space().dof()),
        centres_m_(problem.robot->description().spheres.size()),
        distances_m_(centres_m_.size()),
        statuses_(centres_m_.size()) {
    description_ = "Path length and clearance";
  }

  ob::Cost stateCost(const ob::State* state) const override {
    const double missing = std::max(0.0, 1.0 - clearance_of(state) / clearance_m_);
    return ob::Cost(share_ + weight_ * missing * missing);
  }
  /// No motion costs less than its length's share.
  ob::Cost motionCostHeuristic(const ob::State* from, const ob::State* to) const override {
    return ob::Cost(share_ * si_->distance(from, to));
  }

 private:
  [[nodiscard]] double clearance_of(const ob::State* state) const {
    const std::scoped_lock lock(mutex_);
    const RobotDescription& robot = problem_.robot->description();
    search_.to_joints(state, q_);
    problem_.robot->sphere_centres(q_, centres_m_, scratch_);
    query_with_policy(*problem_.field, problem_.space, centres_m_, distances_m_, {}, statuses_);
    double least_m = std::numeric_limits<double>::infinity();
    for (std::size_t s = 0; s < centres_m_.size(); ++s) {
      least_m = std::min(
          {least_m, distances_m_[s] - robot.spheres[s].radius_m, above_floor_(s, centres_m_[s])});
    }
    return least_m;
  }

  double share_;
  double weight_;
  double clearance_m_;
  const Problem& problem_;
  const Search& search_;
  FloorClearance above_floor_;
  mutable std::mutex mutex_;  ///< Of what follows: planners may have threads of their own.
  mutable std::vector<double> q_;
  mutable std::vector<Eigen::Vector3d> centres_m_;
  mutable std::vector<double> distances_m_;
  mutable std::vector<FieldStatus> statuses_;
  mutable Scratch scratch_;
};

/// What the options ask planners to minimise, in seconds at full speed: the length of the path, or
/// the integral along it of
///
///     share + weight * max(0, 1 - clearance / clearance_m)^2
///
/// with share 1 for `length_and_clearance`; for `clearance` it is so small that it decides only
/// between paths that are equally clear. Clearance is that of the sphere nearest to an obstacle or
/// the floor. `problem` and `search` must outlive it.
ob::OptimizationObjectivePtr make_objective(const ob::SpaceInformationPtr& information,
                                            const Options& options, const Problem& problem,
                                            const Search& search) {
  if (options.objective == "length") {
    return std::make_shared<ob::PathLengthOptimizationObjective>(information);
  }
  const double share = options.objective == "clearance" ? kTieBreak : 1.0;
  return std::make_shared<KeepingClear>(information, share, options, problem, search);
}

constexpr double kGoalTolerance = 1e-9;  // in the scaled space: the goal is met exactly

std::vector<double> configurations(const Problem& problem, const Search& search,
                                   const og::PathGeometric& path) {
  const std::size_t dof = search.space().dof();
  std::vector<double> q(path.getStateCount() * dof);
  for (std::size_t i = 0; i < path.getStateCount(); ++i) {
    search.to_joints(path.getState(static_cast<unsigned>(i)), std::span(q).subspan(i * dof, dof));
  }
  // Exactly, not up to the rounding of the scaled space.
  std::copy_n(problem.start.q.data(), dof, q.begin());
  const Eigen::Map<Eigen::VectorXd> end(&q[q.size() - dof], static_cast<Eigen::Index>(dof));
  const auto off = [&](const Eigen::VectorXd& goal) { return (goal - end).squaredNorm(); };
  const Eigen::VectorXd goal = *std::ranges::min_element(search.space().goals(), {}, off);
  std::copy_n(goal.data(), dof, q.end() - static_cast<std::ptrdiff_t>(dof));
  return q;
}

std::string number(double value) { return format("%.17g", value); }
std::string seconds(double value) { return format("%.3g s", value); }

std::vector<ob::ScopedState<>> start_and_goals(const Problem& problem, const Search& search,
                                               const ob::SpaceInformationPtr& information) {
  std::vector<ob::ScopedState<>> ends(1 + search.space().goals().size(),
                                      ob::ScopedState<>(information));
  search.from_joints({problem.start.q.data(), search.space().dof()}, ends[0].get());
  for (std::size_t i = 1; i < ends.size(); ++i) {
    search.from_joints({search.space().goals()[i - 1].data(), search.space().dof()}, ends[i].get());
  }
  return ends;
}

/// Some planners know what to do with one goal only.
void set_ends(const std::vector<ob::ScopedState<>>& ends, ob::ProblemDefinition& definition) {
  if (ends.size() == 2) {
    definition.setStartAndGoalStates(ends[0], ends[1], kGoalTolerance);
    return;
  }
  definition.addStartState(ends[0]);
  const auto goals = std::make_shared<ob::GoalStates>(definition.getSpaceInformation());
  goals->setThreshold(kGoalTolerance);
  for (std::size_t i = 1; i < ends.size(); ++i) goals->addState(ends[i]);
  definition.setGoal(goals);
}

double path_cost(const ob::OptimizationObjective& objective, const og::PathGeometric& path) {
  double cost = 0.0;
  for (unsigned i = 1; i < path.getStateCount(); ++i) {
    cost += objective.motionCost(path.getState(i - 1), path.getState(i)).value();
  }
  return cost;
}

/// Leaves out every vertex that is not needed, one after the other: random short cuts leave many at
/// which the path hardly turns, where a robot that stops at corners would stop for nothing.
void drop_vertices(og::PathGeometric& path) {
  const ob::SpaceInformationPtr& information = path.getSpaceInformation();
  std::vector<ob::State*>& states = path.getStates();
  for (std::size_t i = 1; i + 1 < states.size();) {
    if (information->checkMotion(states[i - 1], states[i + 1])) {
      information->freeState(states[i]);
      states.erase(states.begin() + static_cast<std::ptrdiff_t>(i));
    } else {
      ++i;
    }
  }
}

class OmplOptimiser final : public PathPlanner {
 public:
  OmplOptimiser(const Options& options, std::uint64_t seed, Log& log)
      : PathPlanner(options, seed, log), options_(options) {}

 private:
  [[nodiscard]] Result<void> check(const Problem& problem) override {
    return check_weights(options_.joint_metric(), problem.robot->description());
  }
  [[nodiscard]] Result<Solution> search(const Problem& problem,
                                        std::span<const Eigen::VectorXd> goals, Checker& checker,
                                        const Deadline& deadline) override {
    try {
      return search_by_ompl(problem, goals, checker, deadline);
    } catch (const ::ompl::Exception& error) {
      Solution solution;
      solution.reason = std::string("OMPL: ") + error.what();
      return solution;
    }
  }

  [[nodiscard]] Solution search_by_ompl(const Problem& problem,
                                        std::span<const Eigen::VectorXd> goals, Checker& checker,
                                        const Deadline& deadline) {
    const Session session(seed(), log());
    Search search(
        JointSpace(problem, goals, weights_of(problem, options_.joint_metric()), options_.any_turn),
        checker, deadline.capped_s(options_.max_time_s));
    const bool is_connect = options_.planner == "RRTConnect";
    const auto information = make_information(search, {.resolution_m = options_.resolution_m,
                                                       .is_projected = !is_connect,
                                                       .checks_motions_to_states = is_connect});
    const auto definition = std::make_shared<ob::ProblemDefinition>(information);
    const std::vector<ob::ScopedState<>> ends = start_and_goals(problem, search, information);
    set_ends(ends, *definition);
    const auto objective = make_objective(information, options_, problem, search);
    definition->setOptimizationObjective(objective);

    // The straight line is the shortest path, but not the one that keeps farthest away.
    if (options_.objective == "length" &&
        search.is_clear(ends[0].get(), ends[1].get(), options_.resolution_m)) {
      og::PathGeometric straight(information, ends[0].get(), ends[1].get());
      Solution solution = timed(problem, search, checker, straight);
      solution.initial_cost = solution.cost;
      return solution;
    }
    std::atomic<int> iterations = 0;  // planners may have threads of their own
    std::atomic<bool> is_found = false;
    definition->setIntermediateSolutionCallback([&is_found](const ob::Planner*,
                                                            const std::vector<const ob::State*>&,
                                                            ob::Cost) { is_found = true; });
    const ob::PlannerTerminationCondition done([&] {
      const int now = ++iterations;
      return now > options_.max_iterations || search.deadline().expired() ||
             (is_found && now > options_.optimise_iterations);
    });
    const auto planner = make_planner(information);
    planner->setProblemDefinition(definition);
    planner->setup();
    const ob::PlannerStatus status = planner->solve(done);
    if (status != ob::PlannerStatus::EXACT_SOLUTION) return nothing_found(deadline, iterations);

    const bool is_cut = planner->getSpecs().optimizingPaths && search.deadline().expired();
    og::PathGeometric path = *definition->getSolutionPath()->as<og::PathGeometric>();
    const double found_length = path.length();
    if (options_.simplify) simplify(*objective, search.deadline(), path);
    Solution solution = timed(problem, search, checker, path);
    solution.iterations = iterations;
    solution.initial_cost = found_length;
    if (is_cut && solution.status == SolveStatus::kConverged) {
      solution.status = SolveStatus::kDeadline;
      solution.reason = "the deadline ended the search for shorter paths";
    }
    return solution;
  }

  [[nodiscard]] ob::PlannerPtr make_planner(const ob::SpaceInformationPtr& information) const {
    ob::PlannerPtr planner = ompl_optimiser::make_planner(information, options_.planner);
    if (options_.range_s > 0.0 && planner->params().hasParam("range")) {
      (void)set_parameter(*planner, "range", number(options_.range_s));
    }
    for (const Node::Entry& entry : options_.planner_parameters.entries()) {
      (void)set_parameter(*planner, entry.key,
                          entry.value.text());  // Options::check() has tried it
    }
    return planner;
  }

  [[nodiscard]] Solution timed(const Problem& problem, const Search& search, Checker& checker,
                               const og::PathGeometric& path) const {
    Solution solution = joint_paths::timed(problem, configurations(problem, search, path), checker,
                                           options_.resolution_m, search.deadline());
    solution.cost = path.length();
    return solution;
  }

  [[nodiscard]] Solution nothing_found(const Deadline& deadline, int iterations) const {
    Solution solution = no_path(options_.planner + ": no path to the goal in " +
                                std::to_string(iterations) + " iterations");
    solution.iterations = iterations;
    if (deadline.expired()) {
      solution.status = SolveStatus::kDeadline;
      solution.reason += ", when the deadline came";
    } else if (iterations <= options_.max_iterations) {
      solution.reason += " and " + seconds(options_.max_time_s);
    }
    return solution;
  }

  /// Shortens a path, unless what is shorter is worse by the objective.
  void simplify(const ob::OptimizationObjective& objective, const Deadline& deadline,
                og::PathGeometric& path) const {
    og::PathSimplifier simplifier(path.getSpaceInformation());
    const auto tries = static_cast<unsigned>(options_.simplify_tries);
    const unsigned in_vain = std::max(1u, tries / 3);
    const bool may_be_worse = options_.objective != "length";
    for (int round = 0; round < options_.simplify_rounds && !deadline.expired(); ++round) {
      std::optional<og::PathGeometric> before;
      if (may_be_worse) before.emplace(path);
      bool is_changed = simplifier.reduceVertices(path, tries, in_vain);
      is_changed |= simplifier.shortcutPath(path, tries, in_vain);
      if (!is_changed) break;
      drop_vertices(path);
      if (before && path_cost(objective, *before) < path_cost(objective, path)) path = *before;
    }
  }

  Options options_;
};

}  // namespace

std::unique_ptr<Optimiser> make_ompl_optimiser(const Options& options, std::uint64_t seed,
                                               Log& log) {
  return std::make_unique<OmplOptimiser>(options, seed, log);
}

}  // namespace sidestep::ompl_optimiser
