#pragma once

#include "chain_memory.hpp"
#include "state_share.hpp"

namespace sidestep::gp_chain_cuda {

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

}  // namespace sidestep::gp_chain_cuda
