#include <gtest/gtest.h>

#include "conformance/mapper_conformance.hpp"
#include "conformance/test_host.hpp"
#include "voxel_grid.hpp"

namespace sidestep::conformance {
namespace {

MapperCase voxel_grid_case(std::string method, const Eigen::Vector3i& size_vox) {
  MapperCase mapper;
  mapper.name = method;
  mapper.takes_clouds = method != "projective";
  const auto host = std::make_shared<TestHost>();
  mapper.create = [=](WorkerPool& workers) -> std::unique_ptr<Mapper> {
    voxel_grid::VoxelGridOptions options;
    options.size_vox = size_vox;
    options.origin_m = {-0.7, -1.1, 0.0};
    options.resolution_m = 0.03;
    options.method = method;
    return std::move(*voxel_grid::create(options, host->context(workers)));
  };
  return mapper;
}

// Sizes that fill no block and no word, so that the last ones are partly outside.
INSTANTIATE_TEST_SUITE_P(voxel_grid, MapperConformance,
                         testing::Values(voxel_grid_case("projective", {90, 71, 45}),
                                         voxel_grid_case("raycast", {90, 71, 45}),
                                         voxel_grid_case("auto", {128, 64, 48})),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace sidestep::conformance
