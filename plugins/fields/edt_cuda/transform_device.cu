#include "cuda/device_backend.hpp"
#include "transform_on.hpp"

namespace sidestep::edt_cuda {

Result<std::unique_ptr<DistanceTransform>> make_device_transform(const TransformSettings& settings,
                                                                 int ordinal) {
  auto backend = cuda::DeviceBackend::open(ordinal);
  if (!backend) return error_of(backend);
  return make_transform_on(settings, std::move(*backend));
}

}  // namespace sidestep::edt_cuda
