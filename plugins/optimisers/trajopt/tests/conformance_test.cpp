#include "conformance/optimiser_conformance.hpp"
#include "trajopt.hpp"

namespace sidestep::conformance {
namespace {

OptimiserCase by_smoothness(const std::string& smoothness) {
  return {smoothness, [smoothness] { return make_trajopt({.smoothness = smoothness}); }};
}

INSTANTIATE_TEST_SUITE_P(Trajopt, OptimiserConformance,
                         testing::Values(by_smoothness("velocity"), by_smoothness("acceleration")),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
