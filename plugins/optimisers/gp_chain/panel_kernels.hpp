#pragma once

#include <cstddef>
#include <vector>

namespace sidestep {

/// One panel of the factor of a ChainSystem. Column k holds column k of L times its pivot; `rows`
/// holds L itself row by row, without its unit diagonal.
struct ChainPanel {
  double* columns;
  double* rows;
  double* inverse_pivots;
  std::size_t width;  ///< An even number.
  std::size_t own;    ///< Rows of the state's own block, in whole lanes.
  std::size_t next;   ///< Rows of the coupling and b.
};

/// panel = source - (what eliminating the previous panel leaves to this one).
/// `scaled`: room for width + 1 columns of a panel's coupling. What lies above the diagonal, in
/// lanes of their own, is left as it was.
void load_panel(const ChainPanel& panel, const double* source, const ChainPanel* previous,
                double* scaled);

/// Replaces a panel by its factor; false where it is not positive definite.
[[nodiscard]] bool factorise_panel(const ChainPanel& panel, double lambda);

/// x of L^T x = D^-1 (y - W^T next), where y is the panel's row of b and W its coupling. Both x and
/// next have room for, and are zero in, whole lanes beyond the width.
void substitute_panel(const ChainPanel& panel, const double* next, double* x);

/// a . b, of `count` values each.
[[nodiscard]] double dot(const double* a, const double* b, std::size_t count) noexcept;
[[nodiscard]] inline double dot(const std::vector<double>& a,
                                const std::vector<double>& b) noexcept {
  return dot(a.data(), b.data(), a.size());
}

}  // namespace sidestep
