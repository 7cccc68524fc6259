#include "dilation.hpp"

#include <span>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// Every voxel that is set, or has one beside it in x that is.
void widen_row(std::span<const std::uint64_t> row, std::span<std::uint64_t> wide) {
  for (std::size_t w = 0; w < row.size(); ++w) {
    const std::uint64_t before = w > 0 ? row[w - 1] >> 63 : 0;
    const std::uint64_t after = w + 1 < row.size() ? row[w + 1] << 63 : 0;
    wide[w] = row[w] | row[w] << 1 | row[w] >> 1 | before | after;
  }
}

/// `side` rows, `stride` apart, to the left and right of each row of words joined into it.
void join_neighbours(const std::vector<std::uint64_t>& rows, std::size_t words_per_row,
                     std::size_t row_count, std::size_t stride, std::size_t period,
                     std::vector<std::uint64_t>& joined) {
  for (std::size_t row = 0; row < row_count; ++row) {
    const std::size_t place = row / stride % period;
    const std::size_t first = row * words_per_row;
    const std::size_t step = stride * words_per_row;
    for (std::size_t w = first; w < first + words_per_row; ++w) {
      joined[w] =
          rows[w] | (place > 0 ? rows[w - step] : 0) | (place + 1 < period ? rows[w + step] : 0);
    }
  }
}

}  // namespace

void dilate(const VoxelBits& bits, const GridSpec& grid, std::vector<std::uint64_t>& scratch,
            std::vector<std::uint64_t>& wide) {
  const auto per_row = idx(bits.words_per_row);
  const auto ny = idx(grid.size_vox.y());
  const auto nz = idx(grid.size_vox.z());
  wide.resize(bits.words.size());
  scratch.resize(bits.words.size());
  for (std::size_t row = 0; row < ny * nz; ++row) {
    widen_row(bits.words.subspan(row * per_row, per_row),
              std::span(wide).subspan(row * per_row, per_row));
  }
  join_neighbours(wide, per_row, ny * nz, 1, ny, scratch);
  join_neighbours(scratch, per_row, ny * nz, ny, nz, wide);
}

}  // namespace sidestep
