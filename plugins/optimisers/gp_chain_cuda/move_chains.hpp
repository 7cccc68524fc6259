#pragma once

#include "assembly.hpp"
#include "chains.hpp"
#include "damping.hpp"
#include "elimination.hpp"
#include "prior_sample.hpp"
#include "stopping_rules.hpp"

namespace sidestep::gp_chain_cuda {

/// When a minimisation ends, and how it is damped at first.
struct MinimisationRules {
  StoppingRules stop;
  double initial_damping = 0.01;
};

/// Iterations of Levenberg-Marquardt, of every chain that has not ended: gp_chain's minimise() with
/// its LevenbergMarquardt, step by step.
template <int kMaxDof>
struct MoveChains {
  static constexpr int kThreads = 128;
  struct Shared {
    double sums[kThreads];
    Panels<kMaxDof> panels;
  };

  ChainProblem problem;
  Chains chains;
  MinimisationRules rules;
  PriorSamples samples;
  std::int32_t iterations = 1;  ///< Accepted steps, at most.

  SIDESTEP_HOST_DEVICE void run(std::int64_t block, cuda::Team& team, Shared& shared) const {
    ChainState state = chains.states[block];
    if (state.standing != Standing::kNew && state.standing != Standing::kMoving) return;
    Run run{*this, chains.at(block, problem), chains.numbers(block, problem), team, shared, state};
    if (state.standing == Standing::kNew) run.begin();
    for (int i = 0; i < iterations && state.standing == Standing::kMoving; ++i) run.iterate();
    team.each([&](int thread) {
      if (thread == 0) chains.states[block] = state;
    });
  }

 private:
  /// What one block does. What is not in memory that threads share is every thread's own, and the
  /// same.
  struct Run {
    const MoveChains& kernel;
    ChainMemory memory;
    const double* own_numbers;
    cuda::Team& team;
    Shared& shared;
    ChainState& state;

    [[nodiscard]] SIDESTEP_HOST_DEVICE const ChainProblem& problem() const {
      return kernel.problem;
    }

    SIDESTEP_HOST_DEVICE void begin() {
      if (state.sample > 0) kernel.samples.add(problem(), state.sample, team, memory.support);
      state.cost = state.initial_cost = evaluate(memory.support);
      state.lambda = kernel.rules.initial_damping;
      if (!is_finite(state.cost)) {
        state.standing = Standing::kNotFinite;
        return;
      }
      state.standing = Standing::kMoving;
      linearise();
    }

    SIDESTEP_HOST_DEVICE void iterate() {
      const double before = state.cost;
      switch (find_step()) {
        case Outcome::kNoBetter: state.standing = Standing::kConverged; return;
        case Outcome::kSingular: state.standing = Standing::kSingular; return;
        case Outcome::kAccepted: break;
      }
      ++state.accepted;
      state.last_decrease = before - state.cost;
      if (state.last_decrease <= kernel.rules.stop.absolute_tolerance ||
          state.last_decrease <= kernel.rules.stop.relative_tolerance * before) {
        state.standing = Standing::kConverged;
      } else if (state.accepted >= kernel.rules.stop.max_iterations) {
        state.standing = Standing::kIterationLimit;
      } else {
        linearise();
      }
    }

    enum class Outcome { kAccepted, kNoBetter, kSingular };

    SIDESTEP_HOST_DEVICE Outcome find_step() {
      Elimination<kMaxDof> elimination(problem(), memory, shared.panels);
      bool is_solved = false;
      double refused = cuda::kInfinity;  // length of the last refused step
      for (; state.lambda < kLargestDamping; state.lambda *= kDampingFactor) {
        if (!elimination.template solve<kThreads>(team, state.lambda)) continue;
        is_solved = true;
        const double length = sqrt(sum([&](int i) { return memory.step[i] * memory.step[i]; }));
        if (length > kSameLength * refused) continue;
        ++state.tried;
        bool is_worth_more = true;
        if (try_step(is_worth_more)) {
          state.lambda = cuda::most_of(state.lambda / kDampingFactor,
                                       kLeastDampingShare * kernel.rules.initial_damping);
          return Outcome::kAccepted;
        }
        if (!is_worth_more) return Outcome::kNoBetter;
        refused = length;
      }
      return is_solved ? Outcome::kNoBetter : Outcome::kSingular;
    }

    /// Whether the step was accepted; clears `is_worth_more` if a larger lambda is not worth
    /// trying.
    SIDESTEP_HOST_DEVICE bool try_step(bool& is_worth_more) {
      constexpr double kRounding = 2.220446049250313e-16;
      const double predicted =
          0.5 * sum([&](int i) {
            return memory.step[i] * (memory.rhs[i] + state.lambda * memory.step[i]);
          });
      if (!(predicted >= 0.0)) return false;
      each_value([&](int i) { memory.trial[i] = memory.support[i] + memory.step[i]; });
      const double cost = evaluate(memory.trial);
      const double decrease = state.cost - cost;
      if (predicted > kRounding * state.cost && decrease > kLeastFidelity * predicted) {
        each_value([&](int i) { memory.support[i] = memory.trial[i]; });
        state.cost = cost;
        return true;
      }
      const double change = decrease < 0.0 ? -decrease : decrease;
      is_worth_more = !(change < kernel.rules.stop.relative_tolerance * state.cost);
      return false;
    }

    /// The cost of a trajectory; leaves the shares of its states.
    SIDESTEP_HOST_DEVICE double evaluate(const double* support) {
      return team.sum(shared.sums, [&](int thread) {
        double cost = prior_cost(problem(), support, thread, kThreads);
        for (int i = thread; i < problem().all_states(); i += kThreads) {
          StateOnChain<kMaxDof> at(problem(), own_numbers, support, i);
          for (int t = 0; t < problem().terms; ++t) cost += at.add(problem().term[t]);
          at.share().store(problem().dof,
                           memory.shares + std::ptrdiff_t{i} * problem().share_size());
        }
        return cost;
      });
    }

    /// The normal equations at the trajectory that was evaluated last.
    SIDESTEP_HOST_DEVICE void linearise() {
      const Assembly assembly(problem(), memory, memory.support);
      team.each([&](int thread) {
        for (int e = thread; e < assembly.entries(); e += kThreads) assembly.write(e);
      });
    }

    template <class Work>
    SIDESTEP_HOST_DEVICE void each_value(const Work& work) {
      team.each([&](int thread) {
        for (int i = thread; i < problem().values(); i += kThreads) work(i);
      });
    }
    /// Of value(i) of all values of a trajectory.
    template <class Value>
    SIDESTEP_HOST_DEVICE double sum(const Value& value) {
      return team.sum(shared.sums, [&](int thread) {
        double all = 0.0;
        for (int i = thread; i < problem().values(); i += kThreads) all += value(i);
        return all;
      });
    }
  };
};

}  // namespace sidestep::gp_chain_cuda
