#pragma once

#include "chain_memory.hpp"
#include "cuda/team.hpp"

namespace sidestep::gp_chain_cuda {

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
