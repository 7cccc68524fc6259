#include "conformance/optimiser_conformance.hpp"
#include "gp_ceres.hpp"

namespace sidestep::conformance {
namespace {

INSTANTIATE_TEST_SUITE_P(GpCeres, OptimiserConformance,
                         testing::Values(OptimiserCase{"gp_ceres",
                                                       [] { return make_gp_ceres({}); }}),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
