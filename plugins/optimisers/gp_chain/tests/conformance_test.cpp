#include "conformance/optimiser_conformance.hpp"
#include "gp_chain.hpp"

namespace sidestep::conformance {
namespace {

OptimiserCase by_method(const std::string& method) {
  return {method, [method] { return make_gp_chain({.method = method}); }};
}

OptimiserCase incremental() {
  return {"incremental", [] { return make_gp_chain({.incremental = true}); }};
}

INSTANTIATE_TEST_SUITE_P(GpChain, OptimiserConformance,
                         testing::Values(by_method("levenberg_marquardt"), by_method("dogleg"),
                                         incremental()),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
