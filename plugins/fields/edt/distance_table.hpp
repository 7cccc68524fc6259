#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/geometry/grid.hpp>

namespace sidestep::edt {

/// The first squared distance, in voxels, at or beyond a limit; that of the grid's diagonal where
/// the limit is 0, for none, or farther.
[[nodiscard]] std::uint32_t cap_vox2(double max_distance_m, const GridSpec& grid);

/// Metres by squared distance in voxels, from 0 to the cap, which is the limit itself where there
/// is one: infinity for none.
[[nodiscard]] std::vector<float> distance_table(double resolution_m, std::uint32_t cap,
                                                double max_distance_m);

}  // namespace sidestep::edt
