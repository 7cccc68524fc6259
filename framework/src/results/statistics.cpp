#include <sidestep/results/statistics.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace sidestep {

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  const double at = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (at - static_cast<double>(below)) * (values[above] - values[below]);
}

Statistics statistics_of(const std::vector<double>& values) {
  if (values.empty()) return {};
  const auto count = static_cast<double>(values.size());
  Statistics result;
  result.mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  double squares = 0.0;
  for (const double value : values) squares += (value - result.mean) * (value - result.mean);
  if (values.size() > 1) result.sd = std::sqrt(squares / (count - 1.0));
  result.p50 = percentile(values, 0.5);
  result.p95 = percentile(values, 0.95);
  result.max = *std::ranges::max_element(values);
  return result;
}

}  // namespace sidestep
