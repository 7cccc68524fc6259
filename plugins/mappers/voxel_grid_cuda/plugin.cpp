#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "voxel_grid_cuda.hpp"

namespace sidestep::voxel_grid_cuda {
namespace {

Result<std::unique_ptr<Mapper>> create_on_device(const Options& options,
                                                 const HostContext& context) {
  return create(options, context, [device = options.device](const MapSettings& settings) {
    return make_device_map(settings, device);
  });
}

}  // namespace
}  // namespace sidestep::voxel_grid_cuda

SIDESTEP_PLUGIN(sidestep::Mapper, sidestep::voxel_grid_cuda::Options,
                sidestep::voxel_grid_cuda::create_on_device, "voxel_grid_cuda", "0.1.0",
                "Log-odds occupancy on a dense grid on a GPU, the same voxels as voxel_grid",
                sidestep::OccupancyView)
