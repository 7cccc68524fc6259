#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tiled_grid.hpp"

namespace sidestep::edt {

/// One tile of a row, aligned so that it lies in one line of the cache.
template <class Value>
struct alignas(64) TileOf {
  Value values[kTile];
};
using Tile = TileOf<std::uint32_t>;

/// A line of rows, one tile wide: those that matter to its envelope, in order. Rows are held as
/// keys, value << bits | number in this list, whose least is the least value's.
class LineKeys {
 public:
  /// Farther than any grid is wide; its square fits 32 bits.
  static constexpr int kFar = 1 << 15;

  /// Whether lines of at most `length` rows, with squared distances cut off at `cap`, fit the keys.
  [[nodiscard]] static bool fits(int length, std::uint32_t cap);

  LineKeys(int length, std::uint32_t cap);

  void clear() noexcept { count_ = 0; }
  [[nodiscard]] bool is_empty() const noexcept { return count_ == 0; }

  /// Appends, for the row at `position` of the line, the squared distances along x of the tile that
  /// begins at x of a row of occupancy bits that holds obstacles. Positions rise, and are less than
  /// the length.
  void append_scanned(const std::uint64_t* words, int words_per_row, int x, int position);
  /// Appends the rows at these positions that the pass before has left, `stride` tiles apart.
  void append_line(const Tile* tiles, std::ptrdiff_t stride, const std::vector<int>& positions);

  /// The lower envelope of the rows' parabolas at every position of the line, which is not empty:
  /// one tile each.
  void solve(Tile* out) const;

 private:
  int bits_;
  std::uint32_t cap_;
  std::vector<Tile> keys_;
  std::vector<int> positions_;  ///< Of each row on the line.
  /// Of offsets from -length on, in the place of a key's value.
  std::vector<std::uint32_t> squares_;
  int count_ = 0;
};

}  // namespace sidestep::edt
