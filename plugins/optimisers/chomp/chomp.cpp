#include "chomp.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <utility>

#include "waypoints.hpp"

namespace sidestep {

ClearanceCost clearance_cost(double clearance_m, double epsilon_m) noexcept {
  if (clearance_m >= epsilon_m) return {0.0, 0.0};
  if (clearance_m < 0.0) return {0.5 * epsilon_m - clearance_m, -1.0};
  const double within_m = clearance_m - epsilon_m;  // keeps NaN
  return {0.5 * within_m * within_m / epsilon_m, within_m / epsilon_m};
}

ObstacleFunctional::ObstacleFunctional(const Problem& problem, double epsilon_m)
    : problem_(&problem),
      epsilon_m_(std::max(epsilon_m, problem.collision_margin_m)),
      floor_(problem.space, problem.robot->description()),
      spheres_(problem.robot->description().spheres.size()) {}

double ObstacleFunctional::add_gradient(const WaypointStates& states, double weight,
                                        Waypoints& gradient) {
  if (spheres_ == 0 || (!problem_->field && !problem_->space.floor)) return 0.0;
  find_costs(states);
  const double cost = push_centres();
  pull_back(states, weight, gradient);
  return cost;
}

void ObstacleFunctional::find_costs(const WaypointStates& states) {
  const StateBatch all = states.everywhere();
  const std::size_t points = spheres_ * static_cast<std::size_t>(all.count);
  centres_m_.resize(points);
  clearance_m_.assign(points, std::numeric_limits<double>::infinity());
  gradients_.assign(points, Eigen::Vector3d::Zero());
  statuses_.resize(points);
  problem_->robot->sphere_centres(all.q, centres_m_, scratch_);
  if (problem_->field) {
    query_with_policy(*problem_->field, problem_->space, centres_m_, clearance_m_, gradients_,
                      statuses_);
  }
  const auto& described = problem_->robot->description().spheres;
  for (std::size_t p = 0; p < points; ++p) {
    clearance_m_[p] -= described[p % spheres_].radius_m;
    const double above_m = floor_(p % spheres_, centres_m_[p]);
    if (above_m >= clearance_m_[p]) continue;
    clearance_m_[p] = above_m;
    gradients_[p] = Eigen::Vector3d::UnitZ();
  }
}

/// F, and its derivative by every centre.
double ObstacleFunctional::push_centres() {
  pushes_.assign(centres_m_.size(), Eigen::Vector3d::Zero());
  double sum = 0.0;
  for (std::size_t p = spheres_; p + spheres_ < centres_m_.size(); ++p) {
    const auto [cost, slope] = clearance_cost(clearance_m_[p], epsilon_m_);
    if (cost == 0.0) continue;
    const Eigen::Vector3d way_m = 0.5 * (centres_m_[p + spheres_] - centres_m_[p - spheres_]);
    const double length_m = way_m.norm();
    sum += cost * length_m;
    if (length_m <= 0.0) continue;
    pushes_[p] += slope * length_m * gradients_[p];
    const Eigen::Vector3d apart = 0.5 * cost / length_m * way_m;
    pushes_[p + spheres_] += apart;
    pushes_[p - spheres_] -= apart;
  }
  return sum;
}

void ObstacleFunctional::pull_back(const WaypointStates& states, double weight,
                                   Waypoints& gradient) {
  const auto& described = problem_->robot->description().spheres;
  forces_.clear();
  for (std::size_t p = 0; p < pushes_.size(); ++p) {
    if (pushes_[p].isZero(0.0)) continue;
    forces_.push_back({static_cast<int>(p / spheres_), described[p % spheres_].link, pushes_[p],
                       centres_m_[p].cross(pushes_[p])});
  }
  const auto d = static_cast<std::size_t>(states.dof());
  joint_forces_.resize(forces_.size() * d);
  problem_->robot->pull_back(states.everywhere().q, forces_, joint_forces_, scratch_);
  by_q_.setZero(states.dof(), states.states());
  by_qdot_.setZero(states.dof(), states.states());
  for (std::size_t k = 0; k < forces_.size(); ++k) {
    by_q_.col(forces_[k].row) +=
        weight * Eigen::Map<const Eigen::VectorXd>(&joint_forces_[k * d], states.dof());
  }
  states.pull_back(by_q_, by_qdot_, gradient);
}

namespace {

/// The trajectory as it is, and the rule by which it moves.
class Descent final : public WaypointSearch {
 public:
  Descent(const ChompSettings& settings, const Problem& problem, const DifferenceMetric& metric)
      : settings_(settings),
        metric_(metric),
        bounds_(problem, settings.limit_margin),
        states_(problem),
        obstacles_(problem, settings.epsilon_m),
        others_(problem, {"obstacle", "floor", "start", "goal"}),
        rate_(settings.learning_rate) {}

  [[nodiscard]] const Waypoints& best() const noexcept override { return current_; }

  [[nodiscard]] bool begin(Waypoints initial) override {
    current_ = std::move(initial);
    keep_within(bounds_, metric_, current_);
    cost_ = evaluate(current_, gradient_);
    return std::isfinite(cost_);
  }

  [[nodiscard]] SearchEnd run(const Deadline& deadline) override {
    SearchEnd search;
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

  /// U = smoothness + obstacle functional + the problem's other terms, and its gradient.
  [[nodiscard]] double evaluate(const Waypoints& positions, Waypoints& gradient) {
    states_.update(positions);
    gradient.setZero(positions.rows(), positions.cols());
    metric_.add_gradient(positions, settings_.smoothness_weight, gradient);
    return settings_.smoothness_weight * metric_.cost(positions) +
           settings_.obstacle_weight *
               obstacles_.add_gradient(states_, settings_.obstacle_weight, gradient) +
           others_.add_gradient(states_, gradient);
  }

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
      const double cost = evaluate(trial_, trial_gradient_);
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
  const DifferenceMetric& metric_;
  JointBounds bounds_;
  WaypointStates states_;
  ObstacleFunctional obstacles_;
  WaypointTerms others_;
  double rate_;
  Waypoints current_, trial_, gradient_, trial_gradient_;
  double cost_ = 0.0;
};

}  // namespace

std::unique_ptr<Optimiser> make_chomp(const ChompSettings& settings) {
  return make_waypoint_optimiser(
      {"chomp", derivative_of(settings.smoothness), settings.max_iterations,
       [settings](const Problem& problem, const DifferenceMetric& metric) {
         return std::make_unique<Descent>(settings, problem, metric);
       }});
}

}  // namespace sidestep
