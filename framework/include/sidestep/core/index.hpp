#pragma once

#include <cstddef>
#include <limits>
#include <span>

#include <Eigen/Core>

namespace sidestep {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A non-negative index or size of Eigen, or of plain data, as containers take it. [any]
[[nodiscard]] constexpr std::size_t idx(std::ptrdiff_t index) noexcept {
  return static_cast<std::size_t>(index);
}

/// View of a vector's values, which must outlive it. [any]
[[nodiscard]] inline std::span<const double> as_span(const Eigen::VectorXd& values) noexcept {
  return {values.data(), idx(values.size())};
}
[[nodiscard]] inline std::span<double> as_span(Eigen::VectorXd& values) noexcept {
  return {values.data(), idx(values.size())};
}

}  // namespace sidestep
