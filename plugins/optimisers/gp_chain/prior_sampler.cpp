#include "prior_sampler.hpp"

#include <algorithm>
#include <random>
#include <vector>

namespace sidestep {

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
