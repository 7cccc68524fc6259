#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "tiled_grid.hpp"

namespace sidestep::edt {

/// A line of rows, one tile wide: what a pass along y or z works on. Row i of `in` and of `out`
/// starts i * stride values behind it.
struct TileLine {
  int length;
  std::ptrdiff_t stride;
  const std::uint16_t* in;           ///< What the pass before left.
  const std::uint16_t* in_previous;  ///< The same before the update; valid in rows that changed.
  std::ptrdiff_t in_previous_stride;
  std::uint16_t* out;  ///< In: of the old `in`. Out: of the new one.
  std::uint16_t*
      out_previous;  ///< Receives the old values of rows that change, row i at i * kTile.
};

/// Keeps lower envelopes along lines, out[i] = min over j of in[j] + (i - j)^2, cut off at a cap.
/// Holds scratch memory: one for each thread.
class EnvelopeLine {
 public:
  /// For lines of at most `longest` rows. `cap` in [1, 32767].
  EnvelopeLine(int longest, std::uint16_t cap);

  /// Brings line.out up to date after the rows `changed` of line.in, ascending, have changed.
  /// Returns the rows of line.out that now differ from before; valid until the next call.
  std::span<const int> update(const TileLine& line, std::span<const int> changed);

 private:
  enum class Fate : std::uint8_t {
    kKept,     ///< As it was.
    kLowered,  ///< Holds the new minimum.
    kLost,     ///< The old minimum rose: to be computed again.
  };
  struct Source {
    int row;
    int low, high;  ///< The rows that it may change.
  };
  struct Spread;

  void find_sources(const TileLine& line, std::span<const int> changed);
  /// Marks every row that a source reaches.
  void mark_all_lost(const TileLine& line);
  void find_filled(const TileLine& line);
  void recompute(const TileLine& line, int row, bool knows_filled) const;

  std::uint16_t cap_;
  int reach_;  ///< Largest offset whose square is below the cap.
  std::vector<Source> sources_;
  int first_ = 0, last_ = -1;  ///< Of the rows that the sources reach.
  std::int64_t total_reach_ = 0;
  std::vector<std::uint8_t> row_changed_;  ///< All 0 between calls.
  std::vector<Fate> fates_;                ///< All kKept between calls.
  /// For each row within reach of those, the nearest rows before and after it that hold anything
  /// below the cap, if within reach too.
  std::vector<int> before_, after_;
  std::vector<int> changed_;
};

}  // namespace sidestep::edt
