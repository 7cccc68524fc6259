#include "chain_batch_on.hpp"
#include "cuda/device_backend.hpp"

namespace sidestep::gp_chain_cuda {

Result<std::unique_ptr<ChainBatch>> make_device_batch(int ordinal) {
  auto backend = cuda::DeviceBackend::open(ordinal);
  if (!backend) return error_of(backend);
  return std::make_unique<ChainBatchOn<cuda::DeviceBackend>>(std::move(*backend));
}

}  // namespace sidestep::gp_chain_cuda
