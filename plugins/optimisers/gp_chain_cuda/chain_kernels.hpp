#pragma once

#include "chain_problem.hpp"
#include "cuda/kernel.hpp"
#include "normal_equations.hpp"
#include "state_costs.hpp"
#include "stopping_rules.hpp"

/// The kernels of a batch.
namespace sidestep::gp_chain_cuda {

/// How a sample of the GP prior of one joint, for Qc = 1 and with both ends held, follows from
/// normal numbers n, state by state from the last one on: x = G n - F x_next.
struct PriorStep {
  double G[3] = {};     ///< Upper triangular: position by position, by velocity; velocity.
  double F[2][2] = {};  ///< By row.
};

/// Samples of the GP prior: how far motions stray from others, as gp_chain's PriorSampler draws.
struct PriorSamples {
  const PriorStep* steps = nullptr;    ///< Of each support state.
  const double* deviations = nullptr;  ///< sqrt(Qc) of each joint, times what they are spread by.
  const double* normals = nullptr;     ///< Of sample 1, 2, ...: `stride` numbers each.
  std::int64_t stride = 0;

  /// Adds sample number `sample`, counted from 1, to a trajectory.
  SIDESTEP_HOST_DEVICE void add(const ChainProblem& problem, int sample, cuda::Team& team,
                                double* support) const {
    const int d = problem.dof, w = problem.width();
    const double* n = normals + (sample - 1) * stride;
    team.each([&](int joint) {
      if (joint >= d) return;
      double q = 0.0, qdot = 0.0;  // of the state after
      for (int i = problem.states - 2; i > 0; --i) {
        const PriorStep& step = steps[i];
        const double n_q = n[i * w + joint], n_qdot = n[i * w + d + joint];
        const double here =
            step.G[0] * n_q + step.G[1] * n_qdot - (step.F[0][0] * q + step.F[0][1] * qdot);
        qdot = step.G[2] * n_qdot - (step.F[1][0] * q + step.F[1][1] * qdot);
        q = here;
        support[i * w + joint] += deviations[joint] * q;
        support[i * w + d + joint] += deviations[joint] * qdot;
      }
    });
  }
};

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

/// What each term of some chains costs: that of the GP prior, then of each term of the problem.
template <int kMaxDof>
struct PriceTerms {
  static constexpr int kThreads = 128;
  struct Shared {
    double sums[kThreads];
  };

  ChainProblem problem;
  Chains chains;
  const std::int32_t* asked = nullptr;  ///< Numbers of the chains.
  double* costs = nullptr;              ///< 1 + problem.terms of each.

  SIDESTEP_HOST_DEVICE void run(std::int64_t block, cuda::Team& team, Shared& shared) const {
    const double* support = chains.at(asked[block], problem).support;
    const double* own_numbers = chains.numbers(asked[block], problem);
    double* const out = costs + block * (1 + problem.terms);
    const double prior = team.sum(
        shared.sums, [&](int thread) { return prior_cost(problem, support, thread, kThreads); });
    team.each([&](int thread) {
      if (thread == 0) out[0] = prior;
    });
    for (int t = 0; t < problem.terms; ++t) {
      const double of_term = team.sum(shared.sums, [&](int thread) {
        double cost = 0.0;
        for (int i = thread; i < problem.all_states(); i += kThreads) {
          if (!applies(problem.term[t], problem, i)) continue;
          StateOnChain<kMaxDof> at(problem, own_numbers, support, i);
          cost += at.add(problem.term[t]);
        }
        return cost;
      });
      team.each([&](int thread) {
        if (thread == 0) out[1 + t] = of_term;
      });
    }
  }
};

/// Copies trajectories, one after the other, from or to the chains' memory.
struct CopyTrajectories {
  static constexpr int kThreads = 128;
  static constexpr int kPhases = 1;
  struct Shared {};

  ChainProblem problem;
  Chains chains;
  double* trajectories = nullptr;
  bool is_to_chains = false;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t chain, int thread, Shared&) const {
    double* support = chains.at(chain, problem).support;
    double* trajectory = trajectories + chain * problem.values();
    for (int i = thread; i < problem.values(); i += kThreads) {
      (is_to_chains ? support : trajectory)[i] = (is_to_chains ? trajectory : support)[i];
    }
  }
};

/// Puts blocks of a field where they belong.
struct PlaceBlocks {
  static constexpr int kThreads = 256;
  static constexpr int kPhases = 1;
  static constexpr int kVoxels = 4096;
  static constexpr int kRows = 256;
  struct Shared {};

  const std::int32_t* blocks = nullptr;
  const float* distances_m = nullptr;
  const std::uint16_t* known = nullptr;
  float* field_m = nullptr;
  std::uint16_t* field_known = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t item, int thread, Shared&) const {
    const std::ptrdiff_t to = blocks[item];
    for (int v = thread; v < kVoxels; v += kThreads) {
      field_m[to * kVoxels + v] = distances_m[item * kVoxels + v];
    }
    field_known[to * kRows + thread] = known[item * kRows + thread];
  }
};

}  // namespace sidestep::gp_chain_cuda
