#include <sidestep/planning/goal.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/planning/goal_source.hpp>

#include "residual_groups.hpp"

namespace sidestep {
namespace {

bool is_goal_prior(const CostTerm& term) {
  return term.cost && term.placement == Placement::kGoal && term.cost->name() == "goal";
}

std::string term_miss(const StateCost& cost, std::span<const double> q) {
  const std::vector<double> at_rest(q.size());
  const double time_s = 0.0;
  std::vector<double> residuals(idx(cost.residual_count()));
  Scratch scratch;
  cost.evaluate({1, static_cast<int>(q.size()), q, at_rest, {&time_s, 1}}, {residuals, {}, {}},
                scratch);
  for (const ResidualGroup& group : residual_groups(cost)) {
    const double sigmas = group.length(residuals);
    if (sigmas <= kGoalToleranceSigmas) continue;  // what is not a number is a miss
    const ResidualName& name = group.names.front();
    const std::string amount = " " + format("%.4g ", sigmas * name.sigma) + name.unit + " off";
    if (name.target.empty())
      return name.quantity + " of '" + std::string(cost.name()) + "'" + amount;
    return "the " + name.quantity + amount + " " + name.target;
  }
  return "";
}

}  // namespace

std::string configuration_miss(const RobotDescription& robot, std::span<const double> q,
                               const Eigen::VectorXd& wanted) {
  for (std::size_t j = 0; j < q.size(); ++j) {
    const Joint& joint = robot.joints[j];
    double off = std::abs(q[j] - wanted[j]);
    const bool has_no_limit = std::isinf(joint.lower) && std::isinf(joint.upper);
    if (joint.type == Joint::Type::kContinuous && has_no_limit) {
      off = std::abs(std::remainder(off, 2.0 * std::numbers::pi));
    }
    if (off <= kGoalTolerance) continue;
    return "joint '" + robot.joints[j].name + "' " + format("%.4g ", off) + robot.joints[j].unit() +
           " off";
  }
  return "";
}

bool decides_goal(const CostTerm& term) noexcept {
  return term.cost && term.placement == Placement::kGoal && !term.cost->depends_on_velocity();
}

bool is_goal_free(const Problem& problem) noexcept {
  const auto is_at_goal = [](const CostTerm& term) { return term.placement == Placement::kGoal; };
  return std::ranges::any_of(problem.terms, is_at_goal) &&
         std::ranges::none_of(problem.terms, is_goal_prior);
}

std::string goal_cost_names(const Problem& problem) {
  std::string names;
  for (const CostTerm& term : problem.terms) {
    if (!term.cost || term.placement != Placement::kGoal) continue;
    names += (names.empty() ? "'" : ", '") + std::string(term.cost->name()) + "'";
  }
  return names;
}

std::string goal_miss(const Problem& problem, std::span<const double> q) {
  if (!is_goal_free(problem)) {
    return configuration_miss(problem.robot->description(), q, problem.goal.q);
  }
  for (const CostTerm& term : problem.terms) {
    if (!decides_goal(term)) continue;
    std::string miss = term_miss(*term.cost, q);
    if (!miss.empty()) return miss;
  }
  return "";
}

std::string_view to_string(GoalReport::State state) noexcept {
  switch (state) {
    case GoalReport::State::kAccepted: return "accepted";
    case GoalReport::State::kRefused: return "refused";
    case GoalReport::State::kActive: return "active";
    case GoalReport::State::kReached: return "reached";
    case GoalReport::State::kFailed: return "failed";
    case GoalReport::State::kReplaced: return "replaced";
  }
  return "unknown";
}

}  // namespace sidestep
