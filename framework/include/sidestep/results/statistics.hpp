#pragma once

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

}  // namespace sidestep
