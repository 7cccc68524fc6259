#pragma once

#include "chain_memory.hpp"
#include "state_costs.hpp"

namespace sidestep::gp_chain_cuda {

/// The chains of a batch where they lie.
struct Chains {
  double* memory = nullptr;             ///< ChainMemory::size() numbers each.
  const double* own_numbers = nullptr;  ///< problem.own_numbers each.
  ChainState* states = nullptr;

  [[nodiscard]] SIDESTEP_HOST_DEVICE ChainMemory at(std::int64_t chain,
                                                    const ChainProblem& problem) const {
    return {memory + chain * static_cast<std::int64_t>(ChainMemory::size(problem)), problem};
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE const double* numbers(std::int64_t chain,
                                                           const ChainProblem& problem) const {
    return own_numbers + chain * problem.own_numbers;
  }
};

SIDESTEP_HOST_DEVICE inline bool is_finite(double value) { return value - value == 0.0; }

/// Whether a term applies to a state, of all states.
SIDESTEP_HOST_DEVICE inline bool applies(const Term& term, const ChainProblem& problem, int state) {
  switch (term.at) {
    case At::kStart: return state == 0;
    case At::kGoal: return state == problem.all_states() - 1;
    case At::kSupport: return state % (problem.checks + 1) == 0;
    case At::kEverywhere: return true;
  }
  return false;
}

/// The costs of one state of a trajectory, support or interpolated.
template <int kMaxDof>
class StateOnChain {
 public:
  SIDESTEP_HOST_DEVICE StateOnChain(const ChainProblem& problem, const double* own_numbers,
                                    const double* support, int state)
      : problem_(problem),
        state_(state),
        costs_(problem, own_numbers, interpolated(support), qdot_) {}

  SIDESTEP_HOST_DEVICE double add(const Term& term) {
    return applies(term, problem_, state_) ? costs_.add(term) : 0.0;
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE const StateShare<kMaxDof>& share() const {
    return costs_.share();
  }

 private:
  SIDESTEP_HOST_DEVICE const double* interpolated(const double* support) {
    const int d = problem_.dof, interval = state_ / (problem_.checks + 1);
    const int k = state_ % (problem_.checks + 1);
    const double* a = support + interval * problem_.width();
    const double* b = a + problem_.width();
    for (int j = 0; j < d; ++j) {
      q_[j] = a[j];
      qdot_[j] = a[d + j];
      if (k == 0) continue;
      const auto& by = problem_.interpolations[k - 1].by;
      q_[j] = by[0][0] * a[j] + by[0][1] * a[d + j] + by[0][2] * b[j] + by[0][3] * b[d + j];
      qdot_[j] = by[1][0] * a[j] + by[1][1] * a[d + j] + by[1][2] * b[j] + by[1][3] * b[d + j];
    }
    return q_;
  }

  const ChainProblem& problem_;
  int state_;
  double q_[kMaxDof], qdot_[kMaxDof];
  StateCosts<kMaxDof> costs_;
};

}  // namespace sidestep::gp_chain_cuda
