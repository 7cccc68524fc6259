#include <sidestep/plugin/plugin.hpp>

#include "ompl_optimiser.hpp"

namespace sidestep::ompl_optimiser {
namespace {

Result<std::unique_ptr<Optimiser>> create(const Options& options, const HostContext& context) {
  return make_ompl_optimiser(options, context.seed, context.log);
}

}  // namespace
}  // namespace sidestep::ompl_optimiser

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::ompl_optimiser::Options,
                sidestep::ompl_optimiser::create, "ompl", "0.1.0",
                "Sampling-based planners of OMPL, by their names: RRTConnect, BITstar, PRM, ...")
