#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/residual_names.hpp>
#include <sidestep/planning/state_cost.hpp>

namespace sidestep {

/// Residuals of a cost that are the components of one quantity.
struct ResidualGroup {
  std::vector<std::size_t> rows;
  std::vector<ResidualName> names;  ///< One a row.

  /// Of the quantity, in standard deviations, from all residuals of the cost.
  [[nodiscard]] double length(std::span<const double> residuals) const noexcept {
    double sum = 0.0;
    for (const std::size_t row : rows) sum += residuals[row] * residuals[row];
    return std::sqrt(sum);
  }
};

/// All residuals of a cost, by quantity; each by itself, called by its number, where the cost does
/// not name them.
[[nodiscard]] inline std::vector<ResidualGroup> residual_groups(const StateCost& cost) {
  const auto* named = dynamic_cast<const NamesResiduals*>(&cost);
  const int count = cost.residual_count();
  std::vector<ResidualGroup> groups;
  for (int row = 0; row < count; ++row) {
    ResidualName name;
    if (named != nullptr) {
      name = named->residual_name(row);
    } else {
      name.quantity = "row " + std::to_string(row + 1) + " of " + std::to_string(count);
      name.unit = "sigma";
    }
    auto group = std::ranges::find_if(groups, [&](const ResidualGroup& other) {
      return other.names.front().quantity == name.quantity;
    });
    if (group == groups.end()) group = groups.insert(groups.end(), ResidualGroup{});
    group->rows.push_back(idx(row));
    group->names.push_back(std::move(name));
  }
  return groups;
}

}  // namespace sidestep
