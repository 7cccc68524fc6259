#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <sidestep/core/lanes.hpp>

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

/// The panel of a state whose joints are not coupled with each other, as wherever nothing but the
/// GP prior is felt: of each joint a 2x2 block of its own and one that couples the next state to
/// it. Rows of `stride` values, whole lanes, one value a joint. Beyond the last joint the own block
/// is the identity and the rest zero.
struct JointPanel {
  enum Row : std::size_t {
    kOwnQQ,
    kOwnVQ,
    kOwnVV,
    kNextQQ,
    kNextVQ,
    kNextQV,
    kNextVV,  ///< Row of the next state, column of this one.
    kRows
  };
};

/// What eliminating a joint panel leaves: the inverse of its own blocks, and y.
struct JointFactor {
  enum Row : std::size_t { kQQ, kVQ, kVV, kYQ, kYV, kRows };
};

/// What eliminating a joint panel takes from a neighbour: from its own blocks, and from its b.
struct JointRemainder {
  enum Row : std::size_t { kQQ, kVQ, kVV, kBQ, kBV, kRows };
};

/// Which neighbour a joint panel is eliminated into. The one before it is coupled to it by the
/// transpose of the blocks in that neighbour's panel.
enum class Neighbour { kNext, kPrevious };

/// The bits of a panel, columns of `stride` values whose coupling begins at row `own`, that are set
/// only where one joint is coupled with another one.
void mark_couplings(std::size_t stride, std::size_t own, std::size_t dof,
                    std::int64_t* masks) noexcept;

/// Whether a panel couples joints in its own block, and in the coupling to the next state.
void find_couplings(const double* columns, const std::int64_t* masks, std::size_t stride,
                    std::size_t own, std::size_t dof, bool& in_own, bool& in_next) noexcept;

/// Copies such a panel.
void read_joint_panel(const double* columns, std::size_t stride, std::size_t own, std::size_t dof,
                      double* panel) noexcept;

/// Eliminates a state: `own_panel` has its own blocks, `coupling_panel` those between it and the
/// neighbour, `b` its [q; qdot], from which `taken` (or nothing, if null) is taken before; readable
/// in whole lanes. False where it is not positive definite.
[[nodiscard]] bool eliminate_joints(Neighbour into, const double* own_panel,
                                    const double* coupling_panel, const double* b,
                                    const double* taken, double lambda, std::size_t dof,
                                    double* factor, double* remainder) noexcept;

/// Its x, given the neighbour's, each [q; qdot] with room for whole lanes beyond; zero is written
/// there.
void substitute_joints(Neighbour into, const double* factor, const double* coupling_panel,
                       const double* x_neighbour, std::size_t dof, double* x) noexcept;

/// Takes a remainder from a panel, whose b is row `own` + 2 dof.
void take_remainder(const double* remainder, std::size_t stride, std::size_t own, std::size_t dof,
                    double* columns) noexcept;

/// Puts y so that substitution makes of independent normal numbers n = [q; qdot] a sample.
void put_normals(const double* n, std::size_t dof, double* factor) noexcept;

}  // namespace sidestep
