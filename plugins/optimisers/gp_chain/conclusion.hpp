#pragma once

#include <memory>
#include <span>

#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "stopping_rules.hpp"

namespace sidestep {

/// Writes how a minimisation ended into a solution: iterations, status and reason. `cost`: what it
/// came to.
void conclude(const Minimisation& end, const StoppingRules& stop, double cost,
              const Deadline& deadline, Solution& solution);

/// Writes that the initial trajectory's cost is no number, and of which of solution.terms.
void name_broken_term(Solution& solution);

/// `costs`: of the GP prior, then of each term of the problem.
[[nodiscard]] std::vector<TermCost> name_terms(const Problem& problem,
                                               std::span<const double> costs);

/// Which of several trajectories are valid: free of collisions, within the limits of positions, at
/// the goal. How fast they are may still be changed.
class Judge {
 public:
  /// `checks`: of the problem's robot; outlives it, as does the problem.
  Judge(const Problem& problem, const FieldChecks& checks);

  /// False where the deadline passes before it is known.
  [[nodiscard]] bool accepts(const Trajectory& found, const Deadline& deadline) const;

 private:
  const Problem& problem_;
  std::unique_ptr<ValidityCheck> check_;
};

}  // namespace sidestep
