#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep {

/// Writes the voxels that are set, and their 26 neighbours. `scratch` keeps its memory. [any]
void dilate(const VoxelBits& bits, const GridSpec& grid, std::vector<std::uint64_t>& scratch,
            std::vector<std::uint64_t>& wide);

}  // namespace sidestep
