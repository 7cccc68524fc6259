#include "chomp.hpp"

#include <cmath>
#include <deque>
#include <utility>

#include "difference_metric.hpp"
#include "joint_bounds.hpp"
#include "obstacle_functional.hpp"
#include "waypoint_solution.hpp"
#include "waypoint_terms.hpp"

namespace sidestep {
namespace {

/// U = smoothness + obstacle functional + the problem's other terms, and its gradient.
class Objective {
 public:
  Objective(const Problem& problem, const ChompSettings& settings, const DifferenceMetric& metric)
      : settings_(settings),
        metric_(metric),
        states_(problem),
        obstacles_(problem, settings.epsilon_m),
        others_(problem, {"obstacle", "floor", "start", "goal"}) {}

  [[nodiscard]] WaypointStates& states() noexcept { return states_; }

  /// Of waypoints, which it leaves in states().
  [[nodiscard]] double evaluate(const Waypoints& positions, Waypoints& gradient) {
    states_.update(positions);
    gradient.setZero(positions.rows(), positions.cols());
    metric_.add_gradient(positions, settings_.smoothness_weight, gradient);
    return settings_.smoothness_weight * metric_.cost(positions) +
           settings_.obstacle_weight *
               obstacles_.add_gradient(states_, settings_.obstacle_weight, gradient) +
           others_.add_gradient(states_, gradient);
  }

 private:
  const ChompSettings& settings_;
  const DifferenceMetric& metric_;
  WaypointStates states_;
  ObstacleFunctional obstacles_;
  WaypointTerms others_;
};

/// The trajectory as it is, and the rule by which it moves.
class Descent {
 public:
  Descent(const ChompSettings& settings, const JointBounds& bounds, const DifferenceMetric& metric,
          Objective& objective, Waypoints initial)
      : settings_(settings),
        bounds_(bounds),
        metric_(metric),
        objective_(objective),
        rate_(settings.learning_rate),
        current_(std::move(initial)) {
    keep_within(bounds_, metric_, current_);
    cost_ = objective_.evaluate(current_, gradient_);
  }

  [[nodiscard]] const Waypoints& current() const noexcept { return current_; }
  [[nodiscard]] bool is_finite() const noexcept { return std::isfinite(cost_); }

  [[nodiscard]] WaypointSearch run(const Deadline& deadline) {
    WaypointSearch search;
    std::deque<double> history{cost_};
    for (;;) {
      search.objective = cost_;
      search.status = SolveStatus::kDeadline;
      if (deadline.expired()) return search;
      search.status = SolveStatus::kIterationLimit;
      if (search.iterations == settings_.max_iterations) return search;
      ++search.iterations;
      search.status = SolveStatus::kConverged;
      if (!step(deadline)) {
        if (deadline.expired()) search.status = SolveStatus::kDeadline;
        return search;
      }
      ++search.accepted;
      search.last_decrease = history.back() - cost_;
      search.objective = cost_;
      history.push_back(cost_);
      if (static_cast<int>(history.size()) <= settings_.patience) continue;
      const double before = history.front();
      history.pop_front();
      if (before - cost_ <= settings_.relative_tolerance * before) return search;
    }
  }

 private:
  static constexpr double kShortest = 1e-9;  ///< Of the longest step.

  /// xi <- xi - rate A^-1 grad U, projected into the bounds, with the rate halved until that lowers
  /// U. False if none does, or the deadline passes first.
  bool step(const Deadline& deadline) {
    const int inner = metric_.inner();
    const Eigen::MatrixXd direction = metric_.joint_weights().cwiseInverse().asDiagonal() *
                                      metric_.solve(gradient_.middleCols(1, inner)) /
                                      settings_.smoothness_weight;
    for (; rate_ > kShortest * settings_.learning_rate; rate_ *= 0.5) {
      trial_ = current_;
      trial_.middleCols(1, inner) -= rate_ * direction;
      if (!bounds_.contain(trial_)) keep_within(bounds_, metric_, trial_);
      const double cost = objective_.evaluate(trial_, trial_gradient_);
      if (cost < cost_) {
        std::swap(current_, trial_);
        std::swap(gradient_, trial_gradient_);
        cost_ = cost;
        rate_ = std::min(2.0 * rate_, settings_.learning_rate);
        return true;
      }
      if (deadline.expired()) return false;
    }
    return false;
  }

  const ChompSettings& settings_;
  const JointBounds& bounds_;
  const DifferenceMetric& metric_;
  Objective& objective_;
  double rate_;
  Waypoints current_, trial_, gradient_, trial_gradient_;
  double cost_ = 0.0;
};

class Chomp final : public Optimiser {
 public:
  explicit Chomp(const ChompSettings& settings) : settings_(settings) {}

  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) override {
    return solve_between_ends(
        problem, initial, "chomp", settings_.smoothness,
        [&](const DifferenceMetric& metric) { return find(problem, initial, deadline, metric); });
  }

 private:
  [[nodiscard]] Solution find(const Problem& problem, const Trajectory& initial,
                              const Deadline& deadline, const DifferenceMetric& metric) const {
    Objective objective(problem, settings_, metric);
    WaypointStates& states = objective.states();
    const Waypoints guess = states.positions_of(initial);
    states.update(guess);
    Solution solution = begin_solution(problem, states);
    if (solution.status == SolveStatus::kFailed) return solution;

    const JointBounds bounds(problem, settings_.limit_margin);
    Descent descent(settings_, bounds, metric, objective, guess);
    if (!descent.is_finite()) {
      return without_trajectory(SolveStatus::kFailed, kObjectiveNotFinite);
    }
    const WaypointSearch search = descent.run(deadline);
    end_solution(problem, states, guess, descent.current(), search, settings_.max_iterations,
                 deadline, solution);
    return solution;
  }

  ChompSettings settings_;
};

}  // namespace

std::unique_ptr<Optimiser> make_chomp(const ChompSettings& settings) {
  return std::make_unique<Chomp>(settings);
}

}  // namespace sidestep
