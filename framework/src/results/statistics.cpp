#include <sidestep/results/statistics.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

namespace sidestep {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

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

double normal_quantile(double confidence) {
  double low = 0.0, high = 40.0;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erf(middle / std::numbers::sqrt2) < confidence ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

Interval wilson_interval(std::int64_t hits, std::int64_t trials, double confidence) {
  if (trials <= 0) return {kNothing, kNothing};
  const double z = normal_quantile(confidence);
  const auto n = static_cast<double>(trials);
  const double share = static_cast<double>(hits) / n;
  const double scale = 1.0 / (1.0 + z * z / n);
  const double centre = scale * (share + z * z / (2.0 * n));
  const double half = scale * z * std::sqrt(share * (1.0 - share) / n + z * z / (4.0 * n * n));
  // At the ends the limits are the ends themselves, whatever rounding makes of them.
  return {hits == 0 ? 0.0 : std::max(0.0, centre - half),
          hits == trials ? 1.0 : std::min(1.0, centre + half)};
}

Interval bootstrap_ratio(std::span<const double> numerators, std::span<const double> denominators,
                         int samples, double confidence, std::uint64_t seed) {
  const std::size_t clusters = numerators.size();
  if (clusters == 0) return {kNothing, kNothing};
  std::vector<double> ratios;
  std::mt19937_64 random(seed);
  for (int sample = 0; sample < samples; ++sample) {
    double numerator = 0.0, denominator = 0.0;
    for (std::size_t i = 0; i < clusters; ++i) {
      const std::size_t drawn = static_cast<std::size_t>(random() % clusters);
      numerator += numerators[drawn];
      denominator += denominators[drawn];
    }
    if (denominator != 0.0) ratios.push_back(numerator / denominator);
  }
  if (ratios.empty()) return {kNothing, kNothing};
  const double tail = 0.5 * (1.0 - confidence);
  return {percentile(ratios, tail), percentile(ratios, 1.0 - tail)};
}

}  // namespace sidestep
