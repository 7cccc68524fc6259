#pragma once

#include <cstddef>

#include "chain_problem.hpp"

namespace sidestep::gp_chain_cuda {

/// Where the numbers of one chain lie, one after the other: w = 2 d variables a support state,
/// [q; qdot].
struct ChainMemory {
  double* support;    ///< The trajectory as it is now, states x w.
  double* trial;      ///< The one being tried.
  double* step;       ///< From the one to the other.
  double* shares;     ///< Of every state of the trial, as StateShare::store().
  double* own;        ///< Of H, of each support state w x w by rows, the lower half,
  double* couplings;  ///< and the block with the rows of the state that follows.
  double* rhs;        ///< b = -gradient.
  double* factor;     ///< Panels of the factor, (2 w + 1) x w each.

  [[nodiscard]] static SIDESTEP_HOST_DEVICE std::size_t size(const ChainProblem& problem) {
    return static_cast<std::size_t>(ChainMemory(nullptr, problem).end_ -
                                    static_cast<double*>(nullptr));
  }

  SIDESTEP_HOST_DEVICE ChainMemory(double* at, const ChainProblem& problem) {
    const std::ptrdiff_t w = problem.width(), states = problem.states;
    support = at;
    trial = support + states * w;
    step = trial + states * w;
    shares = step + states * w;
    own = shares + std::ptrdiff_t{problem.all_states()} * problem.share_size();
    couplings = own + states * w * w;
    rhs = couplings + states * w * w;
    factor = rhs + states * w;
    end_ = factor + states * (2 * w + 1) * w;
  }

 private:
  double* end_;
};

/// How a chain's minimisation stands.
enum class Standing : std::int32_t {
  kNew,        ///< Its initial trajectory is in place, and was not evaluated yet.
  kMoving,     ///< Linearised; goes on.
  kConverged,  ///< As Minimisation::End, from here on.
  kIterationLimit,
  kSingular,
  kNotFinite,  ///< The initial trajectory's cost is no number.
};

/// What is kept of a chain between launches, and told of it in the end.
struct ChainState {
  Standing standing = Standing::kNew;
  std::int32_t tried = 0;
  std::int32_t accepted = 0;
  std::int32_t sample = 0;  ///< Number of the sample that is added at first; 0 for none.
  double lambda = 0.0;
  double initial_cost = 0.0;
  double cost = 0.0;
  double last_decrease = 0.0;
};

}  // namespace sidestep::gp_chain_cuda
