#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <sidestep/planning/problem.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "chain_costs.hpp"
#include "chain_system.hpp"

namespace sidestep {

/// What of a chain's cost is another than in the problem before.
struct ProblemChange {
  bool chain = true;   ///< Robot, states, times, prior, or which terms there are and where.
  bool start = false;  ///< A term at the start,
  bool goal = false;   ///< at the goal,
  bool along = false;  ///< along the way.
};

/// What must be known of a problem to tell what another one changes. A term has changed if its
/// StateCost is another object: the same one, being immutable, costs what it did. Keeps these
/// objects, and with them the fields that they look into, alive.
class ProblemMemory {
 public:
  /// Allocates only for more joints or terms than ever before.
  void remember(const Problem& problem);
  [[nodiscard]] ProblemChange change_to(const Problem& problem) const;

 private:
  std::shared_ptr<const RobotModel> robot_;
  int support_states_ = 0;
  int interpolated_checks_ = 0;
  double dt_s_ = 0.0;
  Eigen::VectorXd qc_;
  std::vector<CostTerm> terms_;
};

/// The trajectory being improved, its normal equations, and a trial one. An end that no term with
/// placement kStart or kGoal holds is kept at the problem's start or goal. [planning]; allocates in
/// trajectory(), and in reset() only for problems larger than those before.
class ChainModel {
 public:
  /// Takes up a problem, which must outlive what follows, and evaluates the initial trajectory.
  /// `body`: the planar base whose body has the prior, of this problem and those that resume.
  void reset(const Problem& problem, const Trajectory& initial,
             const std::optional<BodyChain::Base>& body = {});

  /// Takes up a problem after a minimisation that went well, where it leads on from there: with the
  /// same robot, sizes, times and prior, terms at the same places, and as its initial trajectory
  /// the current one, but for held ends. Then evaluates only what has changed: of other terms at an
  /// end the state there, of other terms along the way or another held end everything. Else returns
  /// false, and reset() must follow. Each keep() serves one call. Does not allocate.
  [[nodiscard]] bool resume(const Problem& problem, const Trajectory& initial);
  /// Ends the minimisation of a problem, for resume() to lead on from.
  void keep(const Problem& problem);

  /// What is known of the trajectory as it is now.
  [[nodiscard]] const ChainEvaluation& current() const noexcept { return current_; }

  /// As it is now, on its own; allocates.
  [[nodiscard]] Trajectory trajectory() const;

  /// Builds the normal equations at the current trajectory.
  void linearise();
  /// Those of the last linearise().
  [[nodiscard]] ChainSystem& system() noexcept { return system_; }

  /// The cost at the current trajectory plus `step`; states x width values, those of a body's
  /// velocities in its own frame, as in system(). If it is more than
  /// `linearised_below`, the step is not going to be accepted, or no other is to follow:
  /// linearise() then takes longer.
  [[nodiscard]] double try_step(std::span<const double> step,
                                double linearised_below = std::numeric_limits<double>::infinity());
  /// The trajectory that was tried last becomes the current one.
  void accept() noexcept {
    std::swap(current_, trial_);
    unchanged_ = 0;
  }

 private:
  [[nodiscard]] bool is_at(std::span<const double> q, std::span<const double> qdot,
                           int state) const;
  void put_held_ends(const Problem& problem);

  ChainCosts costs_;
  ChainSystem system_;
  ChainEvaluation current_, trial_;
  bool hold_start_ = false;
  bool hold_goal_ = false;
  int unchanged_ = 0;  ///< Panels that linearise() is going to find as the last time.
  bool is_kept_ = false;
  ProblemMemory memory_;
};

}  // namespace sidestep
