#pragma once

#include <span>
#include <vector>

#include <sidestep/planning/problem.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "chain_costs.hpp"
#include "chain_system.hpp"

namespace sidestep {

/// The trajectory being improved, its normal equations, and a trial one. An end that no term with
/// placement kStart or kGoal holds is kept at the problem's start or goal. [planning]; allocates in
/// reset() only, and there only for problems larger than those before.
class ChainModel {
 public:
  /// Takes up a problem, which must outlive what follows, and evaluates the initial trajectory.
  void reset(const Problem& problem, const Trajectory& initial);

  /// What is known of the trajectory as it is now.
  [[nodiscard]] const ChainEvaluation& current() const noexcept { return current_; }

  /// Builds the normal equations at the current trajectory.
  void linearise();
  /// Those of the last linearise().
  [[nodiscard]] ChainSystem& system() noexcept { return system_; }

  /// The cost at the current trajectory plus `step`; states x width values.
  [[nodiscard]] double try_step(std::span<const double> step);
  /// The trajectory that was tried last becomes the current one.
  void accept() noexcept { std::swap(current_, trial_); }

 private:
  const Problem* problem_ = nullptr;
  ChainCosts costs_;
  ChainSystem system_;
  ChainEvaluation current_, trial_;
  bool hold_start_ = false;
  bool hold_goal_ = false;
};

}  // namespace sidestep
