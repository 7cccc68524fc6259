#include "transform_on.hpp"

namespace sidestep::edt_cuda {

Result<std::unique_ptr<DistanceTransform>> make_host_transform(const TransformSettings& settings,
                                                               cuda::HostBackend backend) {
  return make_transform_on(settings, std::make_unique<cuda::HostBackend>(backend));
}

}  // namespace sidestep::edt_cuda
