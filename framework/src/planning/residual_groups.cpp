#include "residual_groups.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep {

double ResidualGroup::length(std::span<const double> residuals) const noexcept {
  double sum = 0.0;
  for (const std::size_t row : rows) sum += residuals[row] * residuals[row];
  return std::sqrt(sum);
}

std::vector<ResidualGroup> residual_groups(const StateCost& cost) {
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
    group->rows.push_back(static_cast<std::size_t>(row));
    group->names.push_back(std::move(name));
  }
  return groups;
}

}  // namespace sidestep
