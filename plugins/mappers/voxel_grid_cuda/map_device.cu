#include "cuda/device_backend.hpp"
#include "map_on.hpp"

namespace sidestep::voxel_grid_cuda {

Result<std::unique_ptr<LogOddsMap>> make_device_map(const MapSettings& settings, int ordinal) {
  auto backend = cuda::DeviceBackend::open(ordinal);
  if (!backend) return error_of(backend);
  return MapOn<cuda::DeviceBackend>::make(settings, std::move(*backend));
}

}  // namespace sidestep::voxel_grid_cuda
