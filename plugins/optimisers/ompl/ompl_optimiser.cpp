#include "ompl_optimiser.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include <ompl/base/MotionValidator.h>
#include <ompl/base/ProblemDefinition.h>
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/objectives/PathLengthOptimizationObjective.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/geometric/PathSimplifier.h>
#include <ompl/util/Exception.h>

#include <sidestep/core/format.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/motion_check.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "joint_space.hpp"
#include "planners.hpp"
#include "session.hpp"

namespace sidestep::ompl_optimiser {
namespace {

namespace ob = ::ompl::base;
namespace og = ::ompl::geometric;

/// Clearance kept beyond the problem's margin, so that whatever is shown clear here can be
/// shown clear again by a check with other steps.
constexpr double kSpareMargin_m = 2e-4;
constexpr int kSimplifyRounds = 3;
constexpr unsigned kSimplifySteps = 100;
constexpr unsigned kSimplifyEmptySteps = 30;
constexpr int kLastValidHalvings = 6;
constexpr double kGoalTolerance = 1e-9;  // in the scaled space: the goal is met exactly

/// One search: the problem in OMPL's terms.
class Search {
 public:
  Search(const Problem& problem, const Deadline& deadline)
      : space_(problem),
        check_(problem.robot, problem.field, problem.space,
               problem.collision_margin_m + kSpareMargin_m),
        deadline_(deadline),
        q_from_(space_.dof()),
        q_to_(space_.dof()) {}

  [[nodiscard]] const JointSpace& space() const noexcept { return space_; }
  [[nodiscard]] const Deadline& deadline() const noexcept { return deadline_; }

  [[nodiscard]] bool is_clear(const ob::State* state) {
    to_joints(state, q_from_);
    return check_.is_clear(q_from_);
  }
  [[nodiscard]] bool is_clear(const ob::State* from, const ob::State* to, double resolution_m) {
    if (deadline_.expired()) return false;  // nothing more is to be found
    to_joints(from, q_from_);
    to_joints(to, q_to_);
    return check_.is_clear(q_from_, q_to_, resolution_m);
  }
  void to_joints(const ob::State* state, std::span<double> q) const {
    const double* u = state->as<ob::RealVectorStateSpace::StateType>()->values;
    space_.to_joints({u, space_.dof()}, q);
  }
  void from_joints(std::span<const double> q, ob::State* state) const {
    double* u = state->as<ob::RealVectorStateSpace::StateType>()->values;
    space_.from_joints(q, {u, space_.dof()});
  }

 private:
  JointSpace space_;
  MotionCheck check_;
  Deadline deadline_;
  std::vector<double> q_from_;
  std::vector<double> q_to_;
};

class ClearStates final : public ob::StateValidityChecker {
 public:
  ClearStates(ob::SpaceInformation* information, Search& search)
      : ob::StateValidityChecker(information), search_(search) {}
  using ob::StateValidityChecker::isValid;
  bool isValid(const ob::State* state) const override {
    return si_->satisfiesBounds(state) && search_.is_clear(state);
  }

 private:
  Search& search_;
};

class ClearMotions final : public ob::MotionValidator {
 public:
  ClearMotions(ob::SpaceInformation* information, Search& search, double resolution_m)
      : ob::MotionValidator(information), search_(search), resolution_m_(resolution_m) {}

  bool checkMotion(const ob::State* from, const ob::State* to) const override {
    const bool is_clear = si_->satisfiesBounds(to) && search_.is_clear(from, to, resolution_m_);
    ++(is_clear ? valid_ : invalid_);
    return is_clear;
  }

  bool checkMotion(const ob::State* from, const ob::State* to,
                   std::pair<ob::State*, double>& last_valid) const override {
    if (checkMotion(from, to)) return true;
    ob::State* part = si_->allocState();
    double clear = 0.0;
    double step = 0.5;
    for (int i = 0; i < kLastValidHalvings; ++i, step *= 0.5) {
      si_->getStateSpace()->interpolate(from, to, clear + step, part);
      if (si_->satisfiesBounds(part) && search_.is_clear(from, part, resolution_m_)) clear += step;
    }
    si_->freeState(part);
    last_valid.second = clear;
    if (last_valid.first != nullptr) {
      si_->getStateSpace()->interpolate(from, to, clear, last_valid.first);
    }
    return false;
  }

 private:
  Search& search_;
  double resolution_m_;
};

ob::SpaceInformationPtr make_information(Search& search, double resolution_m) {
  const JointSpace& joints = search.space();
  auto space = std::make_shared<ob::RealVectorStateSpace>(static_cast<unsigned>(joints.dof()));
  ob::RealVectorBounds bounds(static_cast<unsigned>(joints.dof()));
  for (std::size_t j = 0; j < joints.dof(); ++j) {
    // A joint whose range is a point still needs a little width for OMPL.
    bounds.setLow(static_cast<unsigned>(j), joints.lower(j));
    bounds.setHigh(static_cast<unsigned>(j), std::max(joints.upper(j), joints.lower(j) + 1e-9));
  }
  space->setBounds(bounds);
  auto information = std::make_shared<ob::SpaceInformation>(space);
  information->setStateValidityChecker(std::make_shared<ClearStates>(information.get(), search));
  information->setMotionValidator(
      std::make_shared<ClearMotions>(information.get(), search, resolution_m));
  information->setup();
  return information;
}

std::vector<double> configurations(const Problem& problem, const Search& search,
                                   const og::PathGeometric& path) {
  const std::size_t dof = search.space().dof();
  std::vector<double> q(path.getStateCount() * dof);
  for (std::size_t i = 0; i < path.getStateCount(); ++i) {
    search.to_joints(path.getState(static_cast<unsigned>(i)), std::span(q).subspan(i * dof, dof));
  }
  // Exactly, not up to the rounding of the scaled space.
  std::copy_n(problem.start.q.data(), dof, q.begin());
  std::copy_n(problem.goal.q.data(), dof, q.end() - static_cast<std::ptrdiff_t>(dof));
  return q;
}

std::string seconds(double value) { return format("%.3g s", value); }

Solution no_path(std::string reason) {
  Solution solution;
  solution.status = SolveStatus::kNoPath;
  solution.reason = std::move(reason);
  return solution;
}

std::string why_blocked(const char* which, const Violation& violation) {
  const bool is_limit = violation.kind == Violation::Kind::kPositionLimit;
  return std::string(which) +
         (is_limit                                            ? " breaks a joint limit: "
          : violation.kind == Violation::Kind::kSelfCollision ? " is in self-collision: "
                                                              : " is in collision: ") +
         violation.what();
}

std::string why_not_free(const Problem& problem) {
  std::string names;
  for (const CostTerm& term : problem.terms) {
    if (term.placement != Placement::kGoal) continue;
    names += (names.empty() ? "'" : ", '") + std::string(term.cost->name()) + "'";
  }
  return "the goal configuration is left to costs (" + names +
         "), and sampling planners know of none: give a goal configuration alone, or use an "
         "optimiser that minimises costs, such as gp_chain";
}

class OmplOptimiser final : public Optimiser {
 public:
  OmplOptimiser(const Options& options, std::uint64_t seed, Log& log)
      : options_(options), seed_(seed), log_(log) {}

  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) override;

 private:
  [[nodiscard]] Solution search(const Problem& problem, const Deadline& deadline) const;
  [[nodiscard]] Solution timed(const Problem& problem, const Search& search,
                               const og::PathGeometric& path) const;
  [[nodiscard]] Solution nothing_found(const Deadline& deadline, int iterations) const;
  void simplify(const ob::SpaceInformationPtr& information, const Deadline& deadline,
                og::PathGeometric& path) const;
  void warn_of_moving_ends(const Problem& problem) const;

  Options options_;
  std::uint64_t seed_;
  Log& log_;
};

Result<Solution> OmplOptimiser::solve(const Problem& problem, const Trajectory&,
                                      const Deadline& deadline) {
  const Stopwatch stopwatch;
  if (auto sound = problem.validate(); !sound) {
    return tl::make_unexpected(std::move(sound.error()));
  }
  if (!problem.field) {
    return fail(ErrorCode::kInvalidArgument, "a sampling planner needs a distance field");
  }
  Solution solution;
  const auto blocked = [&](const RobotState& state) {
    return state_violation(problem.robot, problem.field, problem.space,
                           problem.collision_margin_m + kSpareMargin_m,
                           {state.q.data(), static_cast<std::size_t>(state.q.size())});
  };
  if (is_goal_free(problem)) {
    solution = no_path(why_not_free(problem));
  } else if (const auto violation = blocked(problem.start)) {
    solution = no_path(why_blocked("start", *violation));
  } else if (const auto at_goal = blocked(problem.goal)) {
    solution = no_path(why_blocked("goal", *at_goal));
  } else {
    warn_of_moving_ends(problem);
    try {
      solution = search(problem, deadline);
    } catch (const ::ompl::Exception& error) {
      solution.status = SolveStatus::kFailed;
      solution.reason = std::string("OMPL: ") + error.what();
    }
  }
  solution.solve_ms = stopwatch.elapsed_ms();
  return solution;
}

Solution OmplOptimiser::search(const Problem& problem, const Deadline& deadline) const {
  const Session session(seed_, log_);
  Search search(problem, deadline.capped_s(options_.max_time_s));
  const auto information = make_information(search, options_.resolution_m);
  const auto definition = std::make_shared<ob::ProblemDefinition>(information);
  ob::ScopedState<> start(information);
  ob::ScopedState<> goal(information);
  search.from_joints({problem.start.q.data(), search.space().dof()}, start.get());
  search.from_joints({problem.goal.q.data(), search.space().dof()}, goal.get());
  definition->setStartAndGoalStates(start, goal, kGoalTolerance);
  definition->setOptimizationObjective(
      std::make_shared<ob::PathLengthOptimizationObjective>(information));

  if (search.is_clear(start.get(), goal.get(), options_.resolution_m)) {
    og::PathGeometric straight(information, start.get(), goal.get());
    Solution solution = timed(problem, search, straight);
    solution.initial_cost = solution.cost;
    return solution;
  }
  int iterations = 0;
  bool is_found = false;
  definition->setIntermediateSolutionCallback([&is_found](const ob::Planner*,
                                                          const std::vector<const ob::State*>&,
                                                          ob::Cost) { is_found = true; });
  const ob::PlannerTerminationCondition done([&] {
    ++iterations;
    return iterations > options_.max_iterations || search.deadline().expired() ||
           (is_found && iterations > options_.optimise_iterations);
  });
  const auto planner = make_planner(information, options_.planner, options_.range_s);
  planner->setProblemDefinition(definition);
  planner->setup();
  const ob::PlannerStatus status = planner->solve(done);
  if (status != ob::PlannerStatus::EXACT_SOLUTION) return nothing_found(deadline, iterations);

  const bool is_cut = improves_until_stopped(options_.planner) && search.deadline().expired();
  og::PathGeometric path = *definition->getSolutionPath()->as<og::PathGeometric>();
  const double found_length = path.length();
  if (options_.simplify) simplify(information, search.deadline(), path);
  Solution solution = timed(problem, search, path);
  solution.iterations = iterations;
  solution.initial_cost = found_length;
  if (is_cut && solution.status == SolveStatus::kConverged) {
    solution.status = SolveStatus::kDeadline;
    solution.reason = "the deadline ended the search for shorter paths";
  }
  return solution;
}

Solution OmplOptimiser::timed(const Problem& problem, const Search& search,
                              const og::PathGeometric& path) const {
  Solution solution;
  solution.cost = path.length();
  auto trajectory = time_path(problem.robot->description(), configurations(problem, search, path),
                              problem.speed_fraction);
  if (!trajectory) {
    solution.reason = trajectory.error().describe();
    return solution;
  }
  solution.status = SolveStatus::kConverged;
  solution.trajectory = std::move(*trajectory);
  return solution;
}

Solution OmplOptimiser::nothing_found(const Deadline& deadline, int iterations) const {
  Solution solution = no_path(options_.planner + " found no path to the goal in " +
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

void OmplOptimiser::simplify(const ob::SpaceInformationPtr& information, const Deadline& deadline,
                             og::PathGeometric& path) const {
  og::PathSimplifier simplifier(information);
  for (int round = 0; round < kSimplifyRounds && !deadline.expired(); ++round) {
    bool is_changed = simplifier.reduceVertices(path, kSimplifySteps, kSimplifyEmptySteps);
    is_changed |= simplifier.collapseCloseVertices(path, kSimplifySteps, kSimplifyEmptySteps);
    is_changed |= simplifier.shortcutPath(path, kSimplifySteps, kSimplifyEmptySteps);
    if (!is_changed) break;
  }
  simplifier.reduceVertices(path, kSimplifySteps, kSimplifyEmptySteps);
}

void OmplOptimiser::warn_of_moving_ends(const Problem& problem) const {
  if (problem.start.qdot.isZero(1e-9) && problem.goal.qdot.isZero(1e-9)) return;
  log_.warn(
      "the ompl optimiser plans from rest to rest; the velocities of start and goal are ignored");
}

}  // namespace

std::unique_ptr<Optimiser> make_ompl_optimiser(const Options& options, std::uint64_t seed,
                                               Log& log) {
  return std::make_unique<OmplOptimiser>(options, seed, log);
}

}  // namespace sidestep::ompl_optimiser
