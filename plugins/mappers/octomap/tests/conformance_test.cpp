#include <gtest/gtest.h>

#include "conformance/mapper_conformance.hpp"
#include "octomap_mapper.hpp"
#include "support/test_host.hpp"

namespace sidestep::conformance {
namespace {

MapperCase octomap_case() {
  const auto host = std::make_shared<testing_support::TestHost>();
  MapperCase mapper;
  mapper.name = "octomap";
  mapper.create = [=](WorkerPool& workers) -> std::unique_ptr<Mapper> {
    octomap_mapper::OctomapOptions options;
    options.size_vox = {90, 71, 45};
    options.origin_m = {-0.75, -1.2, 0.0};
    options.resolution_m = 0.03;
    const HostContext context = host->context();
    return std::move(*octomap_mapper::create(
        options, {context.log, context.clock, workers, context.documents, 0, {}, {}, nullptr}));
  };
  return mapper;
}

INSTANTIATE_TEST_SUITE_P(octomap, MapperConformance, testing::Values(octomap_case()));

}  // namespace
}  // namespace sidestep::conformance
