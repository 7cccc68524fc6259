#include "conformance/optimiser_conformance.hpp"
#include "stomp.hpp"

namespace sidestep::conformance {
namespace {

INSTANTIATE_TEST_SUITE_P(Stomp, OptimiserConformance,
                         testing::Values(OptimiserCase{"stomp", [] { return make_stomp({}); }}),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
