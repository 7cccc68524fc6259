#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sidestep {

/// The value below which a share of the values lies, linear between two; 0 for no values.
[[nodiscard]] double percentile(std::vector<double> values, double share);

/// What a set of measurements comes to; all 0 for none.
struct Statistics {
  double mean = 0.0;
  double sd = 0.0;  ///< Of the sample; 0 for one value.
  double p50 = 0.0;
  double p95 = 0.0;
  double max = 0.0;
};
[[nodiscard]] Statistics statistics_of(const std::vector<double>& values);

/// A confidence interval; NaN on both sides where there is nothing to go by.
struct Interval {
  double lower = 0.0;
  double upper = 0.0;
};

/// The z with which a normal variable is within [-z, z] with probability `confidence`.
[[nodiscard]] double normal_quantile(double confidence);

/// Wilson's score interval of a share, `hits` of `trials` (Wilson 1927).
[[nodiscard]] Interval wilson_interval(std::int64_t hits, std::int64_t trials, double confidence);

/// Percentile bootstrap of sum(numerators) / sum(denominators), one pair of them a cluster: whole
/// clusters are drawn, as many as there are, `samples` times over, so that what their members have
/// in common is not taken for evidence. The same for the same seed.
[[nodiscard]] Interval bootstrap_ratio(std::span<const double> numerators,
                                       std::span<const double> denominators, int samples,
                                       double confidence, std::uint64_t seed);

}  // namespace sidestep
