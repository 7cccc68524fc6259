#include <gtest/gtest.h>

#include "conformance/mapper_conformance.hpp"
#include "conformance/test_host.hpp"
#include "tsdf_mapper.hpp"

namespace sidestep::conformance {
namespace {

MapperCase tsdf_case(std::string integrator, const Eigen::Vector3i& size_vox) {
  MapperCase mapper;
  mapper.name = integrator;
  const auto host = std::make_shared<TestHost>();
  mapper.create = [=](WorkerPool& workers) -> std::unique_ptr<Mapper> {
    tsdf::TsdfOptions options;
    options.size_vox = size_vox;
    options.origin_m = {-0.7, -1.1, 0.0};
    options.resolution_m = 0.03;
    options.integrator = integrator;
    return std::move(*tsdf::create(options, host->context(workers)));
  };
  return mapper;
}

// Sizes that fill no block and no word, so that the last ones are partly outside.
INSTANTIATE_TEST_SUITE_P(tsdf, MapperConformance,
                         testing::Values(tsdf_case("simple", {90, 71, 45}),
                                         tsdf_case("merged", {90, 71, 45}),
                                         tsdf_case("fast", {90, 71, 45})),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace sidestep::conformance
