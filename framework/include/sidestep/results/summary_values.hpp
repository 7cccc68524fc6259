#pragma once

#include <algorithm>
#include <vector>

#include <nlohmann/json.hpp>

#include <sidestep/results/statistics.hpp>

namespace sidestep {

/// How much one solve's cost may exceed another's and still count as no worse.
inline constexpr double kOnePercent = 1.01;

/// A number of every item.
template <class Item, class Value>
[[nodiscard]] std::vector<double> values_of(const std::vector<Item>& items, Value value) {
  std::vector<double> values;
  for (const Item& item : items) values.push_back(static_cast<double>(value(item)));
  return values;
}

template <class Item, class Holds>
[[nodiscard]] std::vector<Item> those_of(const std::vector<Item>& items, Holds holds) {
  std::vector<Item> those;
  std::ranges::copy_if(items, std::back_inserter(those), holds);
  return those;
}

/// Of how large a share of the items something holds; null for no items.
template <class Item, class Holds>
[[nodiscard]] nlohmann::ordered_json share_of(const std::vector<Item>& items, Holds holds) {
  if (items.empty()) return nullptr;
  return static_cast<double>(std::ranges::count_if(items, holds)) /
         static_cast<double>(items.size());
}

[[nodiscard]] inline nlohmann::ordered_json quantile_json(const std::vector<double>& values,
                                                          double share) {
  if (values.empty()) return nullptr;
  return percentile(values, share);
}

[[nodiscard]] inline nlohmann::ordered_json quantiles_json(const std::vector<double>& values) {
  return {{"p50", quantile_json(values, 0.5)}, {"p95", quantile_json(values, 0.95)}};
}

[[nodiscard]] inline nlohmann::ordered_json quantiles_and_mean_json(
    const std::vector<double>& values) {
  nlohmann::ordered_json json = quantiles_json(values);
  json["mean"] = nullptr;
  if (!values.empty()) json["mean"] = statistics_of(values).mean;
  return json;
}

}  // namespace sidestep
