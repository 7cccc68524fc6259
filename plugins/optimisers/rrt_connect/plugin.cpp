#include <sidestep/plugin/plugin.hpp>

#include "rrt_connect.hpp"

namespace sidestep::rrt_connect {
namespace {

Result<std::unique_ptr<Optimiser>> create(const Options& options, const HostContext& context) {
  return make_rrt_connect(options, context.seed, context.log);
}

}  // namespace
}  // namespace sidestep::rrt_connect

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::rrt_connect::Options, sidestep::rrt_connect::create,
                "rrt_connect", "0.1.0",
                "Sampling-based search: two trees that grow towards each other, in lanes")
