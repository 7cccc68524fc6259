#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/planning/explain.hpp>
#include <sidestep/planning/problem.hpp>

namespace sidestep {

/// How a solve ended.
enum class SolveStatus {
  kConverged,       ///< The stopping rule was met; for sampling planners: a path was found.
  kIterationLimit,  ///< Stopped by the number of iterations; the best so far.
  kDeadline,        ///< Stopped by the deadline; the best so far.
  kNoPath,          ///< Nothing that reaches the goal was found; the trajectory is empty.
  kFailed,          ///< The numbers went wrong (NaN, singular); the trajectory is empty.
};
[[nodiscard]] std::string_view to_string(SolveStatus status) noexcept;

struct TermCost {
  std::string name;
  double cost = 0.0;
};

struct Solution {
  SolveStatus status = SolveStatus::kFailed;
  Trajectory trajectory;
  int iterations = 0;           ///< Accepted or not; samples drawn for a sampling planner.
  int accepted_iterations = 0;  ///< Those that changed the trajectory, as GPMP2 counts them.
  double initial_cost = 0.0;    ///< 1/2 sum of squares; path length for a sampling planner.
  double cost = 0.0;
  std::vector<TermCost> terms;  ///< Final cost by term, the GP prior as "gp_prior".
  double solve_ms = 0.0;        ///< Wall time inside the optimiser.
  std::string reason;           ///< Why it is not better, in words; empty if kConverged.
  /// Active costs and violations, filled in by the caller of the solve (explain.hpp): optimisers
  /// leave it empty.
  std::optional<Explanation> explanation;
};

/// Fails with kInvalidArgument where an initial trajectory is malformed, or has not the states and
/// joints of the problem.
[[nodiscard]] Result<void> check_initial(const Problem& problem, const Trajectory& initial);

/// Solution::reason of a minimisation that ran out of iterations, whose last accepted one lowered
/// the cost by `last_decrease` to `cost`.
[[nodiscard]] std::string iteration_limit_reason(int iterations, double last_decrease, double cost);

/// Finds a trajectory. A solution is a proposal: only a ValidityCheck says that it is valid.
class SIDESTEP_EXPORT Optimiser {
 public:
  virtual ~Optimiser() = default;

  /// Solves from an initial guess (problem.support_states states; sampling planners may ignore
  /// it). Honours the deadline within one iteration. Deterministic for equal inputs and seed,
  /// unless cut short. Fails with kInvalidArgument only. [planning]; allocates.
  [[nodiscard]] virtual Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                               const Deadline& deadline) = 0;
};

}  // namespace sidestep
