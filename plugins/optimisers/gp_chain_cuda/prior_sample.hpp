#pragma once

#include "chain_problem.hpp"
#include "cuda/team.hpp"

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

}  // namespace sidestep::gp_chain_cuda
