#pragma once

#include <cstddef>

#include "chain_problem.hpp"
#include "cuda/kernel.hpp"
#include "state_costs.hpp"

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

/// The normal equations of a chain, entry by entry: each is summed up by one thread, so that the
/// sum's order is always the same.
class Assembly {
 public:
  /// From the shares in `memory`, at the trajectory `support`.
  SIDESTEP_HOST_DEVICE Assembly(const ChainProblem& problem, const ChainMemory& memory,
                                const double* support)
      : problem_(problem), memory_(memory), support_(support) {}

  /// Entries of all: of blocks, of couplings and of b.
  [[nodiscard]] SIDESTEP_HOST_DEVICE int entries() const {
    return problem_.states * (2 * width() + 1) * width();
  }

  SIDESTEP_HOST_DEVICE void write(int entry) const {
    const int w = width();
    const int state = entry / ((2 * w + 1) * w), rest = entry % ((2 * w + 1) * w);
    const int row = rest / w, column = rest % w;
    if (row == 2 * w) {
      memory_.rhs[state * w + column] = is_held(state) ? 0.0 : rhs(state, column);
    } else if (row >= w) {
      const bool is_none = state + 1 == problem_.states || is_held(state) || is_held(state + 1);
      memory_.couplings[(state * w + row - w) * w + column] =
          is_none ? 0.0 : coupling(state, row - w, column);
    } else if (row >= column) {
      memory_.own[(state * w + row) * w + column] =
          is_held(state) ? (row == column ? 1.0 : 0.0) : own(state, row, column);
    }
  }

 private:
  /// A variable of a state: the position (part 0) or the velocity (part 1) of a joint.
  struct Variable {
    int part, joint;
  };

  [[nodiscard]] SIDESTEP_HOST_DEVICE int width() const { return problem_.width(); }
  [[nodiscard]] SIDESTEP_HOST_DEVICE Variable variable(int v) const {
    return {v / problem_.dof, v % problem_.dof};
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE bool is_held(int state) const {
    return (state == 0 && problem_.is_start_held) ||
           (state == problem_.states - 1 && problem_.is_goal_held);
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE StoredShare share(int state) const {
    return {memory_.shares + std::ptrdiff_t{state} * problem_.share_size(), problem_.dof};
  }
  /// Of check k of an interval.
  [[nodiscard]] SIDESTEP_HOST_DEVICE StoredShare share(int interval, int k) const {
    return share(interval * (problem_.checks + 1) + 1 + k);
  }

  /// What an interval's interpolated states add where the variables of parts m and n of
  /// [q_i, qdot_i, q_i+1, qdot_i+1] meet.
  [[nodiscard]] SIDESTEP_HOST_DEVICE double of_interval(int interval, int m, int r, int n,
                                                        int c) const {
    double sum = 0.0;
    for (int k = 0; k < problem_.checks; ++k) {
      const Interpolation& at = problem_.interpolations[k];
      const StoredShare here = share(interval, k);
      sum += at.by[0][m] * at.by[0][n] * here.hessian(r, c);
      if (r == c) sum += at.by[1][m] * at.by[1][n] * here.velocity_hessian(r);
    }
    return sum;
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE double pull_of_interval(int interval, int m, int j) const {
    double sum = 0.0;
    for (int k = 0; k < problem_.checks; ++k) {
      const Interpolation& at = problem_.interpolations[k];
      const StoredShare here = share(interval, k);
      sum += at.by[0][m] * here.gradient(j) + at.by[1][m] * here.velocity_gradient(j);
    }
    return sum;
  }

  [[nodiscard]] SIDESTEP_HOST_DEVICE double own(int state, int row, int column) const {
    const Variable a = variable(row), b = variable(column);
    const bool is_last = state + 1 == problem_.states;
    double sum = 0.0;
    if (a.joint == b.joint) {
      const double weight = problem_.inverse_qc[a.joint];
      if (!is_last) sum += weight * problem_.prior.own[a.part + b.part];
      if (state > 0) sum += weight * problem_.prior.information[a.part + b.part];
    }
    const StoredShare here = share(state * (problem_.checks + 1));
    if (a.part == 0 && b.part == 0) sum += here.hessian(a.joint, b.joint);
    if (a.part == 1 && row == column) sum += here.velocity_hessian(a.joint);
    if (!is_last) sum += of_interval(state, a.part, a.joint, b.part, b.joint);
    if (state > 0) sum += of_interval(state - 1, 2 + a.part, a.joint, 2 + b.part, b.joint);
    return sum;
  }

  [[nodiscard]] SIDESTEP_HOST_DEVICE double coupling(int state, int row, int column) const {
    const Variable a = variable(row), b = variable(column);
    const double prior = a.joint == b.joint
                             ? problem_.inverse_qc[a.joint] * problem_.prior.across[a.part][b.part]
                             : 0.0;
    return prior + of_interval(state, 2 + a.part, a.joint, b.part, b.joint);
  }

  [[nodiscard]] SIDESTEP_HOST_DEVICE double rhs(int state, int v) const {
    const Variable at = variable(v);
    const bool is_last = state + 1 == problem_.states;
    double sum = 0.0;
    if (!is_last) {
      const Force force = prior_force(state, at.joint);
      sum -= at.part == 0 ? force.position : problem_.dt_s * force.position + force.velocity;
    }
    if (state > 0) {
      const Force force = prior_force(state - 1, at.joint);
      sum += at.part == 0 ? force.position : force.velocity;
    }
    const StoredShare here = share(state * (problem_.checks + 1));
    sum -= at.part == 0 ? here.gradient(at.joint) : here.velocity_gradient(at.joint);
    if (!is_last) sum -= pull_of_interval(state, at.part, at.joint);
    if (state > 0) sum -= pull_of_interval(state - 1, 2 + at.part, at.joint);
    return sum;
  }

  /// Q^-1 e of an interval's prior.
  struct Force {
    double position, velocity;
  };
  [[nodiscard]] SIDESTEP_HOST_DEVICE Force prior_force(int interval, int joint) const {
    const int d = problem_.dof;
    const double* a = support_ + interval * width();
    const double* b = a + width();
    const double position = a[joint] + problem_.dt_s * a[d + joint] - b[joint];
    const double velocity = a[d + joint] - b[d + joint];
    const double weight = problem_.inverse_qc[joint];
    const double* q = problem_.prior.information;
    return {weight * (q[0] * position + q[1] * velocity),
            weight * (q[1] * position + q[2] * velocity)};
  }

  const ChainProblem& problem_;
  const ChainMemory& memory_;
  const double* support_;
};

/// What the GP prior costs of every `step`-th interval of a trajectory, from `first` on.
SIDESTEP_HOST_DEVICE inline double prior_cost(const ChainProblem& problem, const double* support,
                                              int first, int step) {
  const int d = problem.dof;
  const double* q = problem.prior.information;
  double sum = 0.0;
  for (int i = first; i + 1 < problem.states; i += step) {
    const double* a = support + i * problem.width();
    const double* b = a + problem.width();
    for (int j = 0; j < d; ++j) {
      const double position = a[j] + problem.dt_s * a[d + j] - b[j];
      const double velocity = a[d + j] - b[d + j];
      sum += problem.inverse_qc[j] * (position * (q[0] * position + q[1] * velocity) +
                                      velocity * (q[1] * position + q[2] * velocity));
    }
  }
  return 0.5 * sum;
}

/// Memory of a block for the elimination of chains of up to kMaxDof joints: a state's panel holds
/// its own block of H, below that the block that couples the next state to it, and b as the last
/// row; the panel before is still needed.
template <int kMaxDof>
struct Panels {
  static constexpr int kWidth = 2 * kMaxDof;
  double panel[2][(2 * kWidth + 1) * kWidth];
  double inverse_pivots[2][kWidth];
  double next[kWidth];    ///< x of the state after.
  double solved[kWidth];  ///< x of this one.
};

/// (H + lambda I) x = b of a chain, by a block-tridiagonal L D L^T.
template <int kMaxDof>
class Elimination {
 public:
  SIDESTEP_HOST_DEVICE Elimination(const ChainProblem& problem, const ChainMemory& memory,
                                   Panels<kMaxDof>& panels)
      : problem_(problem), memory_(memory), panels_(panels) {}

  /// x into memory.step. False where the matrix is not positive definite.
  template <int kThreads>
  SIDESTEP_HOST_DEVICE bool solve(cuda::Team& team, double lambda) {
    for (int state = 0; state < problem_.states; ++state) {
      load<kThreads>(team, state, lambda);
      if (!factorise<kThreads>(team, state)) return false;
    }
    for (int state = problem_.states - 1; state >= 0; --state) {
      substitute_back<kThreads>(team, state);
    }
    return true;
  }

 private:
  [[nodiscard]] SIDESTEP_HOST_DEVICE int width() const { return problem_.width(); }
  [[nodiscard]] SIDESTEP_HOST_DEVICE double* factor(int state) const {
    return memory_.factor + std::ptrdiff_t{state} * (2 * width() + 1) * width();
  }

  /// A state's panel, less what eliminating the one before leaves to it.
  template <int kThreads>
  SIDESTEP_HOST_DEVICE void load(cuda::Team& team, int state, double lambda) {
    const int w = width();
    double* const panel = panels_.panel[state % 2];
    const double* const before = panels_.panel[(state + 1) % 2];
    const double* const inverse = panels_.inverse_pivots[(state + 1) % 2];
    team.each([&](int thread) {
      for (int e = thread; e < (2 * w + 1) * w; e += kThreads) {
        const int row = e / w, column = e % w;
        if (row < column) continue;
        double value;
        if (row < w) {
          value = memory_.own[(state * w + row) * w + column] + (row == column ? lambda : 0.0);
        } else if (row < 2 * w) {
          value = memory_.couplings[(state * w + row - w) * w + column];
        } else {
          value = memory_.rhs[state * w + column];
        }
        if (state > 0 && (row < w || row == 2 * w)) {
          const double* left = before + (row < w ? w + row : row) * w;
          const double* right = before + (w + column) * w;
          for (int k = 0; k < w; ++k) value -= left[k] * inverse[k] * right[k];
        }
        panel[e] = value;
      }
    });
  }

  /// Replaces a panel by its factor, column k being L's times its pivot, and keeps it.
  template <int kThreads>
  SIDESTEP_HOST_DEVICE bool factorise(cuda::Team& team, int state) {
    const int w = width();
    double* const panel = panels_.panel[state % 2];
    double* const inverse_pivots = panels_.inverse_pivots[state % 2];
    for (int k = 0; k < w; ++k) {
      const double pivot = panel[k * w + k];
      if (!(pivot > 0.0)) {
        team.each([](int) {});  // all have read what the next panel overwrites
        return false;
      }
      const double inverse = 1.0 / pivot;
      const int columns = w - 1 - k;
      team.each([&](int thread) {
        if (thread == 0) inverse_pivots[k] = inverse;
        for (int e = thread; e < (2 * w - k) * columns; e += kThreads) {
          const int row = k + 1 + e / columns, column = k + 1 + e % columns;
          if (row < column) continue;
          panel[row * w + column] -= panel[row * w + k] * inverse * panel[column * w + k];
        }
      });
    }
    double* const kept = factor(state);
    team.each([&](int thread) {
      for (int e = thread; e < (2 * w + 1) * w; e += kThreads) kept[e] = panel[e];
    });
    return true;
  }

  /// x of a state from that of the next.
  template <int kThreads>
  SIDESTEP_HOST_DEVICE void substitute_back(cuda::Team& team, int state) {
    const int w = width();
    const double* const kept = factor(state);
    double* const solved = panels_.solved;
    double* const next = panels_.next;
    const bool is_last = state + 1 == problem_.states;
    team.each([&](int thread) {
      for (int k = thread; k < w; k += kThreads) {
        double sum = kept[2 * w * w + k];
        for (int r = 0; r < w && !is_last; ++r) sum -= kept[(w + r) * w + k] * next[r];
        solved[k] = sum / kept[k * w + k];
      }
    });
    for (int j = w - 1; j > 0; --j) {
      team.each([&](int thread) {
        for (int r = thread; r < j; r += kThreads) {
          solved[r] -= kept[j * w + r] / kept[r * w + r] * solved[j];
        }
      });
    }
    team.each([&](int thread) {
      for (int k = thread; k < w; k += kThreads) {
        next[k] = solved[k];
        memory_.step[state * w + k] = solved[k];
      }
    });
  }

  const ChainProblem& problem_;
  const ChainMemory& memory_;
  Panels<kMaxDof>& panels_;
};

}  // namespace sidestep::gp_chain_cuda
