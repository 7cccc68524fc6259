#include "prior_chain.hpp"

#include <algorithm>
#include <random>
#include <vector>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// e_i of one joint: position and velocity at both ends of an interval.
Eigen::Vector2d error(const double* a, const double* b, std::size_t joint, std::size_t dof,
                      double dt_s) noexcept {
  return {a[joint] + dt_s * a[dof + joint] - b[joint], a[dof + joint] - b[dof + joint]};
}

/// Adds a 2x2 block of one joint to a block of [q; qdot] whose columns are `stride` apart.
void add_block(double* block, const Eigen::Matrix2d& values, std::size_t joint, std::size_t dof,
               std::size_t stride) noexcept {
  for (Eigen::Index column = 0; column < 2; ++column) {
    double* to = block + (joint + static_cast<std::size_t>(column) * dof) * stride;
    to[joint] += values(0, column);
    to[joint + dof] += values(1, column);
  }
}

}  // namespace

bool PriorChain::reset(const Eigen::VectorXd& qc, double dt_s, std::span<const int> apart) {
  const auto inverse_of = [&](int joint) {
    return std::ranges::find(apart, joint) == apart.end() ? 1.0 / qc[joint] : 0.0;
  };
  bool is_same = dt_s == dt_s_ && std::ssize(inverse_qc_) == qc.size();
  for (int j = 0; is_same && j < qc.size(); ++j) is_same = inverse_qc_[idx(j)] == inverse_of(j);
  if (is_same) return false;
  dt_s_ = dt_s;
  information_ << 12.0 / (dt_s * dt_s * dt_s), -6.0 / (dt_s * dt_s),  //
      -6.0 / (dt_s * dt_s), 4.0 / dt_s;
  inverse_qc_.clear();
  for (int j = 0; j < qc.size(); ++j) inverse_qc_.push_back(inverse_of(j));
  return true;
}

double PriorChain::cost(std::span<const double> support) const noexcept {
  const std::size_t d = inverse_qc_.size();
  double sum = 0.0;
  for (std::size_t at = 0; at + 2 * d < support.size(); at += 2 * d) {
    const double* a = support.data() + at;
    for (std::size_t j = 0; j < d; ++j) {
      const Eigen::Vector2d e = error(a, a + 2 * d, j, d, dt_s_);
      sum += inverse_qc_[j] * e.dot(information_ * e);
    }
  }
  return 0.5 * sum;
}

void PriorChain::add_hessian(ChainSystem& system) const noexcept {
  const std::size_t d = inverse_qc_.size();
  Eigen::Matrix2d phi;
  phi << 1.0, dt_s_, 0.0, 1.0;
  const Eigen::Matrix2d own = phi.transpose() * information_ * phi;
  const Eigen::Matrix2d across = -information_ * phi;
  for (int i = 0; i + 1 < system.states(); ++i) {
    for (std::size_t j = 0; j < d; ++j) {
      const double weight = inverse_qc_[j];
      add_block(system.own_block(i), weight * own, j, d, system.stride());
      add_block(system.coupling(i), weight * across, j, d, system.stride());
      add_block(system.own_block(i + 1), weight * information_, j, d, system.stride());
    }
  }
}

void PriorChain::add_rhs(ChainSystem& system, std::span<const double> support) const noexcept {
  const std::size_t d = inverse_qc_.size();
  for (int i = 0; i + 1 < system.states(); ++i) {
    const double* a = support.data() + static_cast<std::size_t>(i) * 2 * d;
    double* here = system.rhs(i);
    double* next = system.rhs(i + 1);
    for (std::size_t j = 0; j < d; ++j) {
      const Eigen::Vector2d force =
          inverse_qc_[j] * (information_ * error(a, a + 2 * d, j, d, dt_s_));
      here[j] -= force[0];
      here[d + j] -= dt_s_ * force[0] + force[1];
      next[j] += force[0];
      next[d + j] += force[1];
    }
  }
}

void PriorSampler::reset(const Problem& problem) {
  const int width = 2 * static_cast<int>(problem.qc.size());
  PriorChain prior;
  prior.reset(problem.qc, problem.dt_s);
  system_.resize(problem.support_states, width);
  prior.add_hessian(system_);
  system_.hold(0);
  system_.hold(problem.support_states - 1);
  system_.seal();
  std::vector<double> zero(static_cast<std::size_t>(problem.support_states * width));
  // Where the prior's numbers are beyond double precision, so is every sample, and the cost says
  // so.
  (void)system_.solve(0.0, zero);
}

void PriorSampler::draw(std::uint64_t seed, std::span<double> out) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  const auto width = static_cast<std::size_t>(system_.width());
  for (double& value : out) value = normal(generator);
  std::ranges::fill(out.first(width), 0.0);
  std::ranges::fill(out.last(width), 0.0);
  system_.spread(out);
}

}  // namespace sidestep
