#include "chomp.hpp"
#include "conformance/optimiser_conformance.hpp"

namespace sidestep::conformance {
namespace {

OptimiserCase by_smoothness(const std::string& smoothness) {
  return {smoothness, [smoothness] { return make_chomp({.smoothness = smoothness}); }};
}

INSTANTIATE_TEST_SUITE_P(Chomp, OptimiserConformance,
                         testing::Values(by_smoothness("acceleration"), by_smoothness("velocity")),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
