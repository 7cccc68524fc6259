#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/tsdf_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "tsdf_mapper.hpp"

SIDESTEP_PLUGIN(sidestep::Mapper, sidestep::tsdf::TsdfOptions, sidestep::tsdf::create, "tsdf",
                "0.1.0", "Truncated signed distances along rays in blocks, as in Voxblox",
                sidestep::TsdfView, sidestep::OccupancyView)
