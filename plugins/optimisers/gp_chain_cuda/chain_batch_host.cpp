#include "chain_batch_on.hpp"

namespace sidestep::gp_chain_cuda {

Result<std::unique_ptr<ChainBatch>> make_host_batch(cuda::HostBackend backend) {
  return std::make_unique<ChainBatchOn<cuda::HostBackend>>(
      std::make_unique<cuda::HostBackend>(std::move(backend)));
}

}  // namespace sidestep::gp_chain_cuda
