#pragma once

#include <memory>
#include <vector>

#include <sidestep/planning/problem.hpp>

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

}  // namespace sidestep
