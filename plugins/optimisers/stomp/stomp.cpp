#include "stomp.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <random>
#include <utility>

#include "waypoints.hpp"

namespace sidestep {

void weigh(std::span<const double> costs, double sensitivity, std::span<double> probabilities) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const double cost : costs) {
    if (!std::isfinite(cost)) continue;
    least = std::min(least, cost);
    most = std::max(most, cost);
  }
  const double range = most - least;
  double sum = 0.0;
  for (std::size_t k = 0; k < costs.size(); ++k) {
    const double above = range > 0.0 ? (costs[k] - least) / range : 0.0;
    probabilities[k] = std::isfinite(costs[k]) ? std::exp(-sensitivity * above) : 0.0;
    sum += probabilities[k];
  }
  if (sum <= 0.0) return;
  for (double& probability : probabilities) probability /= sum;
}

Eigen::MatrixXd weighed_deviation(const std::vector<const Rollout*>& rollouts,
                                  const Waypoints& current, double sensitivity) {
  const Eigen::Index inner = current.cols() - 2;
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(current.rows(), inner);
  std::vector<double> costs(rollouts.size()), probabilities(rollouts.size());
  for (Eigen::Index i = 0; i < inner; ++i) {
    for (std::size_t k = 0; k < rollouts.size(); ++k) {
      costs[k] = rollouts[k]->costs[static_cast<std::size_t>(i) + 1];
    }
    weigh(costs, sensitivity, probabilities);
    for (std::size_t k = 0; k < rollouts.size(); ++k) {
      if (probabilities[k] == 0.0) continue;
      sum.col(i) += probabilities[k] * (rollouts[k]->positions.col(i + 1) - current.col(i + 1));
    }
  }
  return sum;
}

Exploration::Exploration(const DifferenceMetric& metric)
    : metric_(metric), column_scales_(metric.inner()) {
  const int n = metric.inner();
  double largest = 0.0;
  for (int i = 0; i < n; ++i) {
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(1, n);
    unit(0, i) = 1.0;
    const Eigen::MatrixXd column = metric.solve(unit);
    largest = std::max(largest, column(0, i));
    column_scales_[i] = 1.0 / (n * column.maxCoeff());
  }
  scale_ = 1.0 / std::sqrt(largest);
}

Eigen::MatrixXd Exploration::noise(const Eigen::MatrixXd& z,
                                   const Eigen::VectorXd& deviations) const {
  return (scale_ * deviations).asDiagonal() * metric_.colour(z);
}

Eigen::MatrixXd Exploration::smooth(const Eigen::MatrixXd& x) const {
  return metric_.solve(x * column_scales_.asDiagonal());
}

namespace {

/// What a path costs, without derivatives. One thread at a time.
class PathCosts {
 public:
  PathCosts(const Problem& problem, const DifferenceMetric& metric, double smoothness_weight)
      : metric_(metric),
        smoothness_weight_(smoothness_weight),
        states_(problem),
        terms_(problem, {"start", "goal"}) {}

  /// Fills in the costs of a rollout's positions. What a state between two waypoints costs is
  /// shared by both.
  void evaluate(Rollout& rollout) {
    states_.update(rollout.positions);
    at_states_.assign(static_cast<std::size_t>(states_.states()), 0.0);
    terms_.add_costs(states_, at_states_);
    rollout.costs.assign(static_cast<std::size_t>(states_.waypoints()), 0.0);
    rollout.total = smoothness_weight_ * metric_.cost(rollout.positions);
    const auto step = static_cast<std::size_t>(states_.step());
    for (std::size_t s = 0; s < at_states_.size(); ++s) {
      const double later = static_cast<double>(s % step) / static_cast<double>(step);
      rollout.costs[s / step] += (1.0 - later) * at_states_[s];
      if (later > 0.0) rollout.costs[s / step + 1] += later * at_states_[s];
      rollout.total += at_states_[s];
    }
    rollout.is_known = true;
  }

 private:
  const DifferenceMetric& metric_;
  double smoothness_weight_;
  WaypointStates states_;
  WaypointTerms terms_;
  std::vector<double> at_states_;
};

/// Standard deviations of the joints' noise.
Eigen::VectorXd deviations(const Problem& problem, double noise_s) {
  Eigen::VectorXd out(problem.qc.size());
  for (Eigen::Index j = 0; j < out.size(); ++j) {
    const Joint& joint = problem.robot->description().joints[static_cast<std::size_t>(j)];
    const double range = joint.upper - joint.lower;
    out[j] = noise_s * (std::isfinite(joint.max_velocity) ? joint.max_velocity : 1.0);
    if (std::isfinite(range)) out[j] = std::min(out[j], 0.5 * range);
  }
  return out;
}

/// One solve.
class Search final : public WaypointSearch {
 public:
  Search(const Problem& problem, const StompSettings& settings, const DifferenceMetric& metric,
         WorkerPool* workers, std::uint64_t seed)
      : settings_(settings),
        metric_(metric),
        exploration_(metric),
        bounds_(problem, settings.limit_margin),
        deviations_(deviations(problem, settings.noise_s)),
        workers_(workers),
        random_(seed) {
    const int parallel = workers == nullptr ? 1 : settings.rollouts;
    for (int i = 0; i < parallel; ++i) {
      costs_.push_back(std::make_unique<PathCosts>(problem, metric, settings.smoothness_weight));
    }
  }

  [[nodiscard]] const Waypoints& best() const noexcept override { return best_.positions; }

  [[nodiscard]] bool begin(Waypoints initial) override {
    current_.positions = std::move(initial);
    keep_within(bounds_, metric_, current_.positions);
    costs_.front()->evaluate(current_);
    best_ = current_;
    return std::isfinite(best_.total);
  }

  [[nodiscard]] SearchEnd run(const Deadline& deadline) override {
    SearchEnd search;
    std::deque<double> history{best_.total};
    for (;; ++search.iterations) {
      search.objective = best_.total;
      search.status = SolveStatus::kDeadline;
      if (deadline.expired()) return search;
      search.status = SolveStatus::kIterationLimit;
      if (search.iterations == settings_.max_iterations) return search;
      const double before = best_.total;
      iterate(search.iterations, deadline);
      if (best_.total < before) {
        ++search.accepted;
        search.last_decrease = before - best_.total;
      }
      history.push_back(best_.total);
      if (static_cast<int>(history.size()) <= settings_.patience) continue;
      const double lately = history.front() - best_.total;
      history.pop_front();
      if (lately > settings_.relative_tolerance * best_.total) continue;
      ++search.iterations;
      search.objective = best_.total;
      search.status = deadline.expired() ? SolveStatus::kDeadline : SolveStatus::kConverged;
      return search;
    }
  }

 private:
  void iterate(int iteration, const Deadline& deadline) {
    const double scale = std::pow(settings_.noise_decay, iteration);
    const std::size_t fresh = static_cast<std::size_t>(settings_.rollouts) - kept_.size();
    rollouts_.assign(fresh, {});
    for (Rollout& rollout : rollouts_) rollout.positions = perturbed(scale);
    evaluate(deadline);
    std::vector<const Rollout*> known{&current_};
    for (const Rollout& rollout : kept_) known.push_back(&rollout);
    for (const Rollout& rollout : rollouts_) {
      if (!rollout.is_known) continue;
      known.push_back(&rollout);
      if (rollout.total < best_.total) best_ = rollout;
    }
    if (deadline.expired()) return;
    Rollout next;
    next.positions = current_.positions;
    next.positions.middleCols(1, metric_.inner()) +=
        exploration_.smooth(weighed_deviation(known, current_.positions, settings_.sensitivity));
    if (!bounds_.contain(next.positions)) keep_within(bounds_, metric_, next.positions);
    costs_.front()->evaluate(next);
    keep_best();
    current_ = std::move(next);
    if (current_.total < best_.total) best_ = current_;
  }

  /// The current path with noise between its ends.
  [[nodiscard]] Waypoints perturbed(double scale) {
    std::normal_distribution<double> normal;
    Eigen::MatrixXd z(current_.positions.rows(), metric_.inner());
    for (double& value : z.reshaped()) value = normal(random_);
    Waypoints positions = current_.positions;
    positions.middleCols(1, metric_.inner()) += exploration_.noise(z, scale * deviations_);
    if (!bounds_.contain(positions)) keep_within(bounds_, metric_, positions);
    return positions;
  }

  void evaluate(const Deadline& deadline) {
    const int count = static_cast<int>(rollouts_.size());
    const auto go = [&](int i) {
      const auto at = static_cast<std::size_t>(i);
      if (!deadline.expired()) costs_[at % costs_.size()]->evaluate(rollouts_[at]);
    };
    if (workers_ != nullptr) {
      workers_->run(count, go);
    } else {
      for (int i = 0; i < count; ++i) go(i);
    }
  }

  /// The best of all rollouts so far, for the next iteration.
  void keep_best() {
    std::ranges::move(rollouts_, std::back_inserter(kept_));
    std::erase_if(kept_, [](const Rollout& rollout) { return !std::isfinite(rollout.total); });
    std::ranges::stable_sort(kept_, {}, &Rollout::total);
    kept_.resize(std::min(kept_.size(), static_cast<std::size_t>(settings_.reused)));
  }

  const StompSettings& settings_;
  const DifferenceMetric& metric_;
  Exploration exploration_;
  JointBounds bounds_;
  Eigen::VectorXd deviations_;
  WorkerPool* workers_;
  std::mt19937_64 random_;
  std::vector<std::unique_ptr<PathCosts>> costs_;  ///< One of each rollout that runs at a time.
  Rollout current_, best_;
  std::vector<Rollout> rollouts_, kept_;
};

}  // namespace

std::vector<OptionMistake> StompSettings::check() const {
  if (reused < rollouts) return {};
  return {{{"reused", "rollouts"},
           "must be below `rollouts`, which is " + std::to_string(rollouts) +
               ": nothing new would be tried",
           {}}};
}

std::unique_ptr<Optimiser> make_stomp(const StompSettings& settings, WorkerPool* workers,
                                      std::uint64_t seed) {
  return make_waypoint_optimiser(
      {"stomp", derivative_of(settings.smoothness), settings.max_iterations,
       [=](const Problem& problem, const DifferenceMetric& metric) {
         return std::make_unique<Search>(problem, settings, metric, workers, seed);
       }});
}

}  // namespace sidestep
