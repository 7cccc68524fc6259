#include "map_on.hpp"

namespace sidestep::voxel_grid_cuda {

Result<std::unique_ptr<LogOddsMap>> make_host_map(const MapSettings& settings,
                                                  cuda::HostBackend backend) {
  return MapOn<cuda::HostBackend>::make(settings, std::make_unique<cuda::HostBackend>(backend));
}

}  // namespace sidestep::voxel_grid_cuda
