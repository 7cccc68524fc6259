#include "trajopt.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <sidestep/core/format.hpp>

#include "convex_model.hpp"
#include "waypoints.hpp"

namespace sidestep {
namespace {

// Schulman 2014, algorithm 1.
constexpr double kLeastFidelity = 0.2;  ///< Of what a program promises, for a step to be accepted.
constexpr double kGrow = 1.5, kShrink = 0.1;  ///< Of the trust region.
constexpr double kLeastTrust = 1e-4;          ///< m, rad

/// One solve.
class Sequence final : public WaypointSearch {
 public:
  Sequence(const Problem& problem, const TrajoptSettings& settings, const DifferenceMetric& metric)
      : settings_(settings),
        metric_(metric),
        bounds_(problem, settings.limit_margin),
        model_(problem, metric, settings.smoothness_weight,
               std::max(settings.keep_m, problem.collision_margin_m), settings.reach_m) {}

  [[nodiscard]] const Waypoints& best() const noexcept override { return current_; }

  [[nodiscard]] bool begin(Waypoints initial) override {
    current_ = std::move(initial);
    keep_within(bounds_, metric_, current_);
    merit_ = model_.evaluate(current_);
    trust_ = settings_.trust_region;
    return std::isfinite(merit_.value(settings_.initial_penalty));
  }

  [[nodiscard]] SearchEnd run(const Deadline& deadline) override {
    const Round round = escalate(deadline);
    switch (round) {
      case Round::kInterrupted: search_.status = SolveStatus::kDeadline; break;
      case Round::kLimit: search_.status = SolveStatus::kIterationLimit; break;
      case Round::kSingular:
        search_.status = SolveStatus::kFailed;
        search_.reason =
            "a quadratic program could not be solved: qc or the weight of a term is too large or "
            "too small for double precision";
        break;
      case Round::kSettled:
        if (merit_.worst_m <= settings_.violation_m) break;
        search_.status = SolveStatus::kIterationLimit;
        search_.reason =
            "after " + std::to_string(settings_.max_penalties) +
            format(" increases of the penalty a sphere is still %.2g m ", merit_.worst_m) +
            "nearer to an obstacle or the floor than it is to keep";
    }
    return search_;
  }

 private:
  enum class Round {
    kSettled,      ///< No step lowers the merit by enough.
    kLimit,        ///< Of the number of programs.
    kInterrupted,  ///< The deadline passed.
    kSingular      ///< A program could not be solved.
  };

  /// Escalates the penalty until nothing is nearer than it may be.
  Round escalate(const Deadline& deadline) {
    double penalty = settings_.initial_penalty;
    for (int escalations = 0;; ++escalations) {
      const Round round = settle(penalty, deadline);
      search_.objective = merit_.value(penalty);
      const bool is_over = round != Round::kSettled || merit_.worst_m <= settings_.violation_m;
      if (is_over || escalations == settings_.max_penalties) return round;
      penalty *= settings_.penalty_factor;
      trust_ = std::max(trust_, settings_.trust_region);
    }
  }

  /// Programs about ever better paths, with one penalty.
  Round settle(double penalty, const Deadline& deadline) {
    for (;;) {
      if (deadline.expired()) return Round::kInterrupted;
      PenaltyQp qp = model_.convexify(current_, penalty);
      const double before = merit_.value(penalty);
      const Round round = step(penalty, deadline, qp);
      if (round != Round::kSettled || trust_ < kLeastTrust) return round;
      const double decrease = before - merit_.value(penalty);
      if (decrease <= settings_.relative_tolerance * before) return Round::kSettled;
    }
  }

  /// Solves one program in ever smaller trust regions until a step keeps what it promises, or the
  /// region is too small.
  Round step(double penalty, const Deadline& deadline, PenaltyQp& qp) {
    const auto inner = current_.middleCols(1, metric_.inner());
    const Eigen::VectorXd here = inner.reshaped();
    const double before = merit_.value(penalty);
    const double model_before = qp.value(Eigen::VectorXd::Zero(here.size()));
    for (; trust_ >= kLeastTrust; trust_ *= kShrink) {
      if (search_.iterations == settings_.max_iterations) return Round::kLimit;
      ++search_.iterations;
      qp.lower = (bounds_.lower.replicate(inner.cols(), 1) - here).cwiseMax(-trust_);
      qp.upper = (bounds_.upper.replicate(inner.cols(), 1) - here).cwiseMin(trust_);
      const auto found = minimise(qp);
      if (!found) return Round::kSingular;
      Waypoints trial = current_;
      trial.middleCols(1, metric_.inner()) += found->reshaped(current_.rows(), metric_.inner());
      const double promised = model_before - qp.value(*found);
      if (promised <= 1e-3 * settings_.relative_tolerance * before) return Round::kSettled;
      const Merit merit = model_.evaluate(trial);
      const double achieved = before - merit.value(penalty);
      if (achieved > kLeastFidelity * promised) {
        current_ = std::move(trial);
        merit_ = merit;
        trust_ = std::min(kGrow * trust_, 10.0 * settings_.trust_region);
        ++search_.accepted;
        search_.last_decrease = achieved;
        return Round::kSettled;
      }
      if (deadline.expired()) return Round::kInterrupted;
    }
    return Round::kSettled;
  }

  const TrajoptSettings& settings_;
  const DifferenceMetric& metric_;
  JointBounds bounds_;
  ConvexModel model_;
  Waypoints current_;
  Merit merit_;
  double trust_ = 0.0;
  SearchEnd search_;
};

}  // namespace

std::unique_ptr<Optimiser> make_trajopt(const TrajoptSettings& settings) {
  return make_waypoint_optimiser(
      {"trajopt", derivative_of(settings.smoothness), settings.max_iterations,
       [settings](const Problem& problem, const DifferenceMetric& metric) {
         return std::make_unique<Sequence>(problem, settings, metric);
       }});
}

}  // namespace sidestep
