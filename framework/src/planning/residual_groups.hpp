#pragma once

#include <span>
#include <vector>

#include <sidestep/planning/residual_names.hpp>
#include <sidestep/planning/state_cost.hpp>

namespace sidestep {

/// Residuals of a cost that are the components of one quantity.
struct ResidualGroup {
  std::vector<std::size_t> rows;
  std::vector<ResidualName> names;  ///< One a row.

  /// Of the quantity, in standard deviations, from all residuals of the cost.
  [[nodiscard]] double length(std::span<const double> residuals) const noexcept;
};

/// All residuals of a cost, by quantity; each by itself, called by its number, where the cost does
/// not name them.
[[nodiscard]] std::vector<ResidualGroup> residual_groups(const StateCost& cost);

}  // namespace sidestep
