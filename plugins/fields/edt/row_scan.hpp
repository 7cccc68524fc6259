#pragma once

#include <cstdint>

namespace sidestep::edt {

/// Squared distance of every voxel of a row to the nearest obstacle in it; `cap` where there is
/// none within `reach`, the largest offset whose square is below the cap. Bit i of `words` is voxel
/// i of `size`.
void scan_row(const std::uint64_t* words, int size, std::uint16_t cap, int reach,
              std::uint16_t* out);

}  // namespace sidestep::edt
