#include <gtest/gtest.h>

#include "conformance/mapper_conformance.hpp"
#include "conformance/test_host.hpp"
#include "octomap_mapper.hpp"

namespace sidestep::conformance {
namespace {

MapperCase octomap_case() {
  const auto host = std::make_shared<TestHost>();
  MapperCase mapper;
  mapper.name = "octomap";
  mapper.create = [=](WorkerPool& workers) -> std::unique_ptr<Mapper> {
    octomap_mapper::OctomapOptions options;
    options.size_vox = {90, 71, 45};
    options.origin_m = {-0.75, -1.2, 0.0};
    options.resolution_m = 0.03;
    return std::move(*octomap_mapper::create(options, host->context(workers)));
  };
  return mapper;
}

INSTANTIATE_TEST_SUITE_P(octomap, MapperConformance, testing::Values(octomap_case()));

}  // namespace
}  // namespace sidestep::conformance
