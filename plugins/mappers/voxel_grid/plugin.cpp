#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "voxel_grid.hpp"

SIDESTEP_PLUGIN(sidestep::Mapper, sidestep::voxel_grid::VoxelGridOptions,
                sidestep::voxel_grid::create, "voxel_grid", "0.1.0",
                "Log-odds occupancy on a dense grid, projective for images, ray cast for clouds",
                sidestep::OccupancyView)
