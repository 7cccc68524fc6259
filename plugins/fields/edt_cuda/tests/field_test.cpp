#include "edt_cuda_field.hpp"

#include <limits>
#include <tuple>

#include <sidestep/field/dense_field.hpp>

#include "conformance/field_conformance.hpp"
#include "conformance/test_host.hpp"
#include "support/restless_map.hpp"

namespace sidestep::conformance {
namespace {

using edt_cuda::ChangedDistances;
using edt_cuda::DistanceTransform;
using edt_cuda::MakeTransform;
using edt_cuda::TransformSettings;
using testing_support::RestlessMap;
using testing_support::updated;

MakeTransform host_transforms() {
  return [](const TransformSettings& settings) {
    return edt_cuda::make_host_transform(settings, cuda::HostBackend());
  };
}

edt_cuda::Options gpu_options(const edt::Options& edt_options, std::string fallback = "none") {
  edt_cuda::Options options;
  static_cast<edt::Options&>(options) = edt_options;
  options.fallback = std::move(fallback);
  return options;
}

FieldCase gpu_case(std::string name, bool is_signed, double max_distance_m, std::string unknown) {
  FieldCase field;
  field.name = std::move(name);
  field.is_signed = is_signed;
  field.unknown_is_occupied = unknown == "occupied";
  if (max_distance_m > 0.0) field.max_distance_m = max_distance_m;
  const auto host = std::make_shared<TestHost>();
  const auto options = gpu_options({is_signed, max_distance_m, std::move(unknown)});
  field.create = [host, options](WorkerPool& workers) {
    return edt_cuda::make_edt_cuda_builder(options, workers, host->log(), host_transforms());
  };
  return field;
}

INSTANTIATE_TEST_SUITE_P(edt_cuda, FieldConformance,
                         testing::Values(gpu_case("unsigned", false, 0.4, "free"),
                                         gpu_case("signed", true, 0.4, "free"),
                                         gpu_case("between_voxels", false, 0.33, "free"),
                                         gpu_case("one_voxel", true, 0.05, "free"),
                                         gpu_case("unlimited", false, 0.0, "free"),
                                         gpu_case("signed_unlimited", true, 0.0, "free"),
                                         gpu_case("unknown_occupied", true, 0.4, "occupied")),
                         [](const testing::TestParamInfo<FieldCase>& tested) {
                           return tested.param.name;
                         });

/// A map that also lies on a "device": rows of blocks beside the rows of the grid.
class MapOnDevice : public RestlessMap, public cuda::DeviceOccupancyView {
 public:
  MapOnDevice(const GridSpec& grid, unsigned seed, int ordinal = cuda::HostBackend::kOrdinal)
      : RestlessMap(grid, seed),
        ordinal_(ordinal),
        occupied_(static_cast<std::size_t>(block_counts(grid).prod()) * cuda::kBlockRows),
        known_(occupied_.size()) {}

  void set(const Eigen::Vector3i& voxel, bool occupied) override {
    RestlessMap::set(voxel, occupied);
    const Eigen::Vector3i block = voxel / kBlockSide_vox;
    const Eigen::Vector3i inner = voxel - block * kBlockSide_vox;
    const auto row =
        static_cast<std::size_t>(block_linear(block, block_counts(grid()))) * cuda::kBlockRows +
        static_cast<std::size_t>(inner.y() + kBlockSide_vox * inner.z());
    const auto bit = static_cast<std::uint16_t>(1u << inner.x());
    known_[row] = static_cast<std::uint16_t>(known_[row] | bit);
    occupied_[row] =
        static_cast<std::uint16_t>(occupied ? occupied_[row] | bit : occupied_[row] & ~bit);
  }
  std::optional<cuda::OccupancyOnDevice> occupancy_on_device() const noexcept override {
    return cuda::OccupancyOnDevice{occupied_.data(), known_.data(), ordinal_};
  }

 private:
  int ordinal_;
  std::vector<std::uint16_t> occupied_, known_;
};

/// Bit for bit, through a sequence of changes.
void expect_equal_fields(RestlessMap& map, FieldBuilder& gpu, FieldBuilder& cpu, int steps) {
  ASSERT_TRUE(gpu.attach(map));
  ASSERT_TRUE(cpu.attach(map));
  for (int step = 0; step < steps; ++step) {
    map.step();
    const MapUpdate update = map.take_update();
    const auto tested = updated(gpu, update);
    const auto expected = updated(cpu, update);
    ASSERT_TRUE(tested && expected);
    ASSERT_EQ(tested->info().max_distance_m, expected->info().max_distance_m);
    for (std::size_t b = 0; b < tested->blocks().size(); ++b) {
      ASSERT_EQ(tested->blocks()[b]->distance_m, expected->blocks()[b]->distance_m)
          << "block " << b << ", step " << step;
      ASSERT_EQ(tested->known_blocks()[b]->rows, expected->known_blocks()[b]->rows)
          << "block " << b << ", step " << step;
    }
  }
}

class EdtCudaField
    : public testing::TestWithParam<std::tuple<Eigen::Vector3i, edt::Options, bool>> {};

TEST_P(EdtCudaField, EqualsEdtBitForBit) {
  const auto& [size, options, is_on_device] = GetParam();
  TestHost host(2);
  const GridSpec grid{Eigen::Vector3d::Zero(), 0.05, size};
  const auto map = is_on_device ? std::make_unique<MapOnDevice>(grid, 11)
                                : std::make_unique<RestlessMap>(grid, 11);
  const auto gpu = edt_cuda::make_edt_cuda_builder(gpu_options(options), host.workers(), host.log(),
                                                   host_transforms());
  const auto cpu = edt::make_edt_builder(options, host.workers());
  expect_equal_fields(*map, *gpu, *cpu, 30);
}

INSTANTIATE_TEST_SUITE_P(
    SizesAndOptions, EdtCudaField,
    testing::Combine(testing::Values(Eigen::Vector3i(75, 49, 33), Eigen::Vector3i(130, 20, 17),
                                     Eigen::Vector3i(64, 32, 16), Eigen::Vector3i(1, 30, 70)),
                     testing::Values(edt::Options{false, 0.8, "free"},
                                     edt::Options{true, 0.33, "free"},
                                     edt::Options{true, 0.0, "free"},
                                     edt::Options{false, 0.05, "occupied"},
                                     edt::Options{true, 0.8, "occupied"}),
                     testing::Bool()));

TEST(EdtCudaMaps, OfAnotherDeviceAreUploaded) {
  TestHost host(2);
  // Whoever read the memory of this map as device 5's would find nothing there.
  class Elsewhere final : public MapOnDevice {
   public:
    using MapOnDevice::MapOnDevice;
    std::optional<cuda::OccupancyOnDevice> occupancy_on_device() const noexcept override {
      return cuda::OccupancyOnDevice{nullptr, nullptr, 5};
    }
  };
  Elsewhere map({Eigen::Vector3d::Zero(), 0.05, Eigen::Vector3i(40, 40, 20)}, 3);
  const edt::Options options{true, 0.4, "free"};
  const auto gpu = edt_cuda::make_edt_cuda_builder(gpu_options(options), host.workers(), host.log(),
                                                   host_transforms());
  expect_equal_fields(map, *gpu, *edt::make_edt_builder(options, host.workers()), 5);
}

/// Fails as a device does that is lost after so many updates.
class LostTransform final : public DistanceTransform {
 public:
  LostTransform(std::unique_ptr<DistanceTransform> transform, int updates)
      : transform_(std::move(transform)), updates_(updates) {}

  Result<std::span<std::uint16_t>> obstacle_rows(std::size_t blocks) override {
    return transform_->obstacle_rows(blocks);
  }
  Result<ChangedDistances> update(std::span<const std::int32_t> blocks) override {
    if (updates_-- <= 0) return fail(ErrorCode::kPlugin, "the device was lost", "CUDA device 0");
    return transform_->update(blocks);
  }
  Result<ChangedDistances> update(std::span<const std::int32_t> blocks,
                                  const cuda::OccupancyOnDevice& map, bool unknown) override {
    if (updates_-- <= 0) return fail(ErrorCode::kPlugin, "the device was lost", "CUDA device 0");
    return transform_->update(blocks, map, unknown);
  }
  int ordinal() const noexcept override { return transform_->ordinal(); }
  const cuda::StageTimes& times() const noexcept override { return transform_->times(); }

 private:
  std::unique_ptr<DistanceTransform> transform_;
  int updates_;
};

MakeTransform lost_after(int updates) {
  return
      [updates](const TransformSettings& settings) -> Result<std::unique_ptr<DistanceTransform>> {
        return std::make_unique<LostTransform>(*host_transforms()(settings), updates);
      };
}
MakeTransform no_device() {
  return [](const TransformSettings&) -> Result<std::unique_ptr<DistanceTransform>> {
    return fail(ErrorCode::kPlugin, "no CUDA device can be used", "CUDA device 0");
  };
}

const GridSpec kSmallGrid{Eigen::Vector3d::Zero(), 0.05, Eigen::Vector3i(40, 40, 20)};

TEST(EdtCudaFallback, NoDeviceIsAnErrorThatNamesTheWayOut) {
  TestHost host(1);
  RestlessMap map(kSmallGrid, 1);
  const auto gpu = edt_cuda::make_edt_cuda_builder(gpu_options({false, 0.4, "free"}),
                                                   host.workers(), host.log(), no_device());
  const auto attached = gpu->attach(map);
  ASSERT_FALSE(attached);
  EXPECT_EQ(attached.error().code, ErrorCode::kPlugin);
  EXPECT_NE(attached.error().hint.find("fallback: cpu"), std::string::npos);
}

TEST(EdtCudaFallback, GoesOnWithoutADevice) {
  TestHost host(1);
  RestlessMap map(kSmallGrid, 1);
  const edt::Options options{true, 0.4, "occupied"};
  const auto gpu = edt_cuda::make_edt_cuda_builder(gpu_options(options, "cpu"), host.workers(),
                                                   host.log(), no_device());
  expect_equal_fields(map, *gpu, *edt::make_edt_builder(options, host.workers()), 10);
  EXPECT_EQ(host.log().count(LogLevel::kWarning), 1);
}

TEST(EdtCudaFallback, GoesOnWhenTheDeviceIsLost) {
  TestHost host(1);
  RestlessMap map(kSmallGrid, 1);
  const edt::Options options{true, 0.4, "free"};
  const auto gpu = edt_cuda::make_edt_cuda_builder(gpu_options(options, "cpu"), host.workers(),
                                                   host.log(), lost_after(4));
  expect_equal_fields(map, *gpu, *edt::make_edt_builder(options, host.workers()), 10);
  ASSERT_EQ(host.log().count(LogLevel::kWarning), 1);
  EXPECT_NE(host.log().messages().front().find("the device was lost"), std::string::npos);
}

TEST(EdtCudaFallback, ALostDeviceIsAnErrorWithoutIt) {
  TestHost host(1);
  RestlessMap map(kSmallGrid, 1);
  const auto gpu = edt_cuda::make_edt_cuda_builder(gpu_options({false, 0.4, "free"}),
                                                   host.workers(), host.log(), lost_after(1));
  ASSERT_TRUE(gpu->attach(map));
  EXPECT_TRUE(gpu->update(map.take_update()));
  map.step();
  const auto lost = gpu->update(map.take_update());
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::kPlugin);
}

TEST(EdtCudaFallback, UpdateBeforeAttachIsAnError) {
  TestHost host(1);
  const auto field = edt_cuda::make_edt_cuda_builder(gpu_options({false, 0.8, "free"}),
                                                     host.workers(), host.log(), no_device())
                         ->update({});
  ASSERT_FALSE(field);
  EXPECT_EQ(field.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace sidestep::conformance
