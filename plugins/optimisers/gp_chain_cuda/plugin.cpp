#include <sidestep/plugin/plugin.hpp>

#include "gp_chain_cuda.hpp"

namespace sidestep::gp_chain_cuda {
namespace {

Result<std::unique_ptr<Optimiser>> create(const Options& options, const HostContext& context) {
  return make_gp_chain_cuda(options, &context.workers, context.log, context.seed,
                            [&] { return make_device_batch(options.device); });
}

}  // namespace
}  // namespace sidestep::gp_chain_cuda

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::gp_chain_cuda::Options,
                sidestep::gp_chain_cuda::create, "gp_chain_cuda", "0.1.0",
                "GP trajectory optimisation (GPMP2) of many starts at once on a GPU")
