#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "conformance/map_bits.hpp"
#include "conformance/mapper_conformance.hpp"
#include "conformance/test_host.hpp"
#include "support/ball_robot.hpp"
#include "support/box_world.hpp"
#include "support/kinect_kitchen.hpp"
#include "voxel_grid_cuda.hpp"

namespace sidestep::voxel_grid_cuda {
namespace {

using conformance::copy_bits;
using conformance::MapperCase;
using conformance::TestHost;
using conformance::WallScene;
using cuda::HostBackend;
using cuda::Order;
using testing_support::BallRobot;
using testing_support::BoxWorld;
using testing_support::kinect;
using testing_support::KinectKitchen;
using testing_support::look_at;

MakeMap on_host(Order order = Order::kForward) {
  return
      [order](const MapSettings& settings) { return make_host_map(settings, HostBackend(order)); };
}

std::unique_ptr<VoxelGridCuda> make_gpu(const Options& options, const HostContext& context,
                                        Order order = Order::kForward) {
  auto mapper = create(options, context, on_host(order));
  if (!mapper) return nullptr;
  return std::unique_ptr<VoxelGridCuda>(dynamic_cast<VoxelGridCuda*>(mapper->release()));
}

MapperCase gpu_mapper_case(std::string method, const Eigen::Vector3i& size_vox) {
  MapperCase mapper;
  mapper.name = method;
  mapper.takes_clouds = method != "projective";
  const auto host = std::make_shared<TestHost>();
  mapper.create = [=](WorkerPool& workers) -> std::unique_ptr<Mapper> {
    Options options;
    options.size_vox = size_vox;
    options.origin_m = {-0.7, -1.1, 0.0};
    options.resolution_m = 0.03;
    options.method = method;
    return make_gpu(options, host->context(workers));
  };
  return mapper;
}

/// Frames of one kind, and the map that they go into.
struct Scene {
  std::string name;
  Options options;
  std::shared_ptr<const RobotModel> robot;
  std::function<std::vector<Frame>()> frames;
};

Options room_options(double resolution_m) {
  Options options;
  options.resolution_m = resolution_m;
  // No whole number of blocks along any axis.
  options.size_vox = (Eigen::Vector3d(4.1, 5.2, 2.3) / resolution_m).cast<int>();
  options.origin_m = {-0.5, -2.6, -0.2};
  options.max_range_m = 3.2;
  options.min_range_m = 0.4;
  return options;
}

/// Floor, wall, table and a thin post, seen from a camera that moves; a box that goes away.
std::vector<Frame> room_frames(int count) {
  std::vector<Frame> frames;
  for (int f = 0; f < count; ++f) {
    BoxWorld room{{{{-9, -9, -1}, {9, 9, 0}},
                   {{3.01, -9, -1}, {9, 9, 1.7}},
                   {{1.21, -0.81, 0.68}, {2.01, 0.91, 0.713}},
                   {{1.503, 1.203, 0}, {1.513, 1.213, 2}}}};
    if (f % 4 < 2) room.boxes.push_back({{0.8, -1.0, 0.0}, {1.1, -0.4, 1.1}});
    const double aside_m = 0.07 * f;
    frames.push_back(
        room.frame(f, kinect(212, 160), look_at({0.1, aside_m, 1.3}, {2.0, 0.1 - aside_m, 0.6})));
  }
  return frames;
}

/// The same as clouds, with points that are none.
std::vector<Frame> as_clouds(std::vector<Frame> frames) {
  for (Frame& frame : frames) {
    const DepthImage image = std::get<DepthImage>(frame.measurement);
    PointCloud cloud;
    for (int v = 0; v < image.camera.height_px; ++v) {
      for (int u = 0; u < image.camera.width_px; ++u) {
        const auto depth_m = static_cast<double>(image.at(u, v));
        cloud.points_m.push_back(image.camera.unproject(u, v, depth_m).cast<float>());
      }
    }
    cloud.points_m.emplace_back(std::nanf(""), 0.0F, 1.0F);
    cloud.points_m.emplace_back(0.0F, 1.0F, INFINITY);
    frame.measurement = std::move(cloud);
  }
  return frames;
}

/// Holes, and depths that are wrong.
std::vector<Frame> with_holes(std::vector<Frame> frames) {
  std::mt19937 random(3);
  for (Frame& frame : frames) {
    for (float& depth_m : std::get<DepthImage>(frame.measurement).depth_m) {
      const auto draw = random() % 40;
      if (draw == 0) depth_m = 0.0F;
      if (draw == 1) depth_m = std::nanf("");
      if (draw == 2) depth_m = -1.0F;
      if (draw == 3) depth_m = INFINITY;
      if (draw == 4) depth_m = 0.02F;
    }
  }
  return frames;
}

std::vector<Frame> with_joints(std::vector<Frame> frames) {
  for (std::size_t f = 0; f < frames.size(); ++f) {
    frames[f].joint_positions = Eigen::Vector3d(1.0, 0.02 * static_cast<double>(f) - 0.1, 0.8);
  }
  return frames;
}

std::vector<Frame> kitchen_frames() {
  std::vector<Frame> frames;
  const KinectKitchen kitchen(SIDESTEP_SHARED_DATA);
  for (int number = 0; number < 300; number += 30) {
    if (auto frame = kitchen.frame(number)) frames.push_back(std::move(*frame));
  }
  return frames;
}

/// Every voxel's log-odds and bits, every changed block and count, frame by frame.
void expect_same_maps(const Scene& scene, Order order) {
  TestHost host(2, {.robot = scene.robot});
  const auto gpu = make_gpu(scene.options, host.context(), order);
  ASSERT_NE(gpu, nullptr);
  voxel_grid::VoxelGrid cpu(scene.options, host.context());
  std::int64_t changed_blocks = 0;
  std::int64_t self = 0;
  for (const Frame& frame : scene.frames()) {
    SCOPED_TRACE("frame " + std::to_string(frame.sequence));
    const auto tested = gpu->integrate(frame);
    const auto expected = cpu.integrate(frame);
    ASSERT_TRUE(tested && expected);
    EXPECT_EQ(tested->sequence, expected->sequence);
    EXPECT_EQ(tested->stamp, expected->stamp);
    ASSERT_EQ(tested->changed_blocks, expected->changed_blocks);
    ASSERT_EQ(copy_bits(*gpu), copy_bits(cpu));
    EXPECT_EQ(tested->counts.points, expected->counts.points);
    EXPECT_EQ(tested->counts.inserted, expected->counts.inserted);
    EXPECT_EQ(tested->counts.floor, expected->counts.floor);
    EXPECT_EQ(tested->counts.self, expected->counts.self);
    EXPECT_EQ(tested->counts.out_of_range, expected->counts.out_of_range);
    EXPECT_EQ(tested->counts.outside_grid, expected->counts.outside_grid);
    EXPECT_EQ(tested->counts.invalid, expected->counts.invalid);
    changed_blocks += static_cast<std::int64_t>(tested->changed_blocks.size());
    self += tested->counts.self;
  }
  EXPECT_GT(changed_blocks, 0);
  EXPECT_EQ(self > 0, scene.robot != nullptr);
  const auto log_odds = gpu->map()->log_odds();
  ASSERT_TRUE(log_odds);
  const GridSpec& grid = gpu->grid();
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    for (int y = 0; y < grid.size_vox.y(); ++y) {
      for (int x = 0; x < grid.size_vox.x(); ++x) {
        const auto block =
            static_cast<std::size_t>(block_linear({x / 16, y / 16, z / 16}, block_counts(grid)));
        const auto at = static_cast<std::size_t>(x % 16 + 16 * (y % 16 + 16 * (z % 16)));
        ASSERT_EQ((*log_odds)[block * cuda::kBlockVoxels + at] / voxel_grid::LogOdds::kUnits,
                  cpu.log_odds({x, y, z}))
            << x << " " << y << " " << z;
      }
    }
  }
}

std::vector<Scene> rendered_scenes() {
  std::vector<Scene> scenes;
  const auto add = [&](std::string name, double resolution_m,
                       std::function<std::vector<Frame>()> frames) -> Scene& {
    return scenes.emplace_back(
        Scene{std::move(name), room_options(resolution_m), nullptr, std::move(frames)});
  };
  const auto images = [](int count) { return [=] { return room_frames(count); }; };
  const auto holes = [] { return with_holes(room_frames(6)); };
  const auto clouds = [](int count) { return [=] { return as_clouds(room_frames(count)); }; };
  const auto robot = std::make_shared<BallRobot>(0.25);
  add("image_5cm", 0.05, images(8));
  add("image_2cm", 0.025, images(4));
  add("image_with_holes", 0.05, holes);
  add("image_clearing", 0.05, holes).options.clear_no_return = true;
  add("image_wide_band", 0.05, images(6)).options.surface_band_vox = 2.5;
  add("image_of_the_robot", 0.05, [] { return with_joints(room_frames(6)); }).robot = robot;
  add("cloud_5cm", 0.05, clouds(8));
  add("cloud_2cm", 0.025, clouds(2));
  add("cloud_of_the_robot", 0.05, [] { return as_clouds(with_joints(room_frames(6))); }).robot =
      robot;
  add("rays_of_an_image", 0.05, holes).options.method = "raycast";
  Scene& clearing = add("rays_clearing", 0.05, holes);
  clearing.options.method = "raycast";
  clearing.options.clear_no_return = true;
  add("images_and_clouds_in_turn", 0.05, [] {
    std::vector<Frame> both = room_frames(8);
    const std::vector<Frame> as_points = as_clouds(both);
    for (std::size_t f = 1; f < both.size(); f += 2) both[f] = as_points[f];
    return both;
  });
  // On the borders of voxels, where rounding decides.
  const WallScene wall(room_options(0.05).grid());
  add("wall_on_a_border", 0.05, [wall] {
    return std::vector<Frame>{wall.frame(0), wall.frame(1, 1), wall.frame(2, 2)};
  });
  add("wall_of_points", 0.05, [wall] {
    return std::vector<Frame>{wall.cloud_frame(0), wall.cloud_frame(1, 1)};
  });
  return scenes;
}

class SameAsVoxelGrid : public testing::TestWithParam<std::tuple<Order, std::size_t>> {};

TEST_P(SameAsVoxelGrid, VoxelForVoxel) {
  const auto& [order, scene] = GetParam();
  expect_same_maps(rendered_scenes()[scene], order);
}

std::string scene_name(const testing::TestParamInfo<std::tuple<Order, std::size_t>>& tested) {
  static constexpr const char* kOrders[] = {"forward", "backward", "shuffled"};
  const auto& [order, scene] = tested.param;
  return rendered_scenes()[scene].name + "_" + kOrders[static_cast<int>(order)];
}

INSTANTIATE_TEST_SUITE_P(Rendered, SameAsVoxelGrid,
                         testing::Combine(testing::Values(Order::kForward, Order::kBackward,
                                                          Order::kShuffled),
                                          testing::Range<std::size_t>(0, 14)),
                         scene_name);

class SameAsVoxelGridInTheKitchen : public testing::TestWithParam<const char*> {};

TEST_P(SameAsVoxelGridInTheKitchen, VoxelForVoxel) {
  const bool is_raycast = GetParam() == std::string("raycast");
  std::vector<Frame> frames = kitchen_frames();
  if (frames.empty()) GTEST_SKIP() << "the recorded kitchen is not there";
  if (is_raycast) frames.resize(2);
  Scene scene{"kitchen", {}, nullptr, [&] { return frames; }};
  scene.options.origin_m = {-2.0, -4.0, -0.1};
  scene.options.method = GetParam();
  expect_same_maps(scene, Order::kForward);
}

INSTANTIATE_TEST_SUITE_P(Methods, SameAsVoxelGridInTheKitchen,
                         testing::Values("projective", "raycast"));

/// Fails as a device does that is lost after so many frames.
class LostMap final : public LogOddsMap {
 public:
  LostMap(std::unique_ptr<LogOddsMap> map, int frames) : map_(std::move(map)), frames_(frames) {}

  Result<MapChange> integrate(const ImageFrame& frame) override {
    if (frames_-- <= 0) return fail(ErrorCode::kPlugin, "the device was lost", "CUDA device 0");
    return map_->integrate(frame);
  }
  Result<MapChange> integrate(const RayFrame& frame) override { return map_->integrate(frame); }
  cuda::OccupancyOnDevice occupancy() const noexcept override { return map_->occupancy(); }
  Result<std::vector<std::int16_t>> log_odds() override { return map_->log_odds(); }
  const cuda::StageTimes& times() const noexcept override { return map_->times(); }

 private:
  std::unique_ptr<LogOddsMap> map_;
  int frames_;
};

MakeMap lost_after(int frames) {
  return [frames](const MapSettings& settings) -> Result<std::unique_ptr<LogOddsMap>> {
    return std::make_unique<LostMap>(*on_host()(settings), frames);
  };
}
MakeMap no_device() {
  return [](const MapSettings&) -> Result<std::unique_ptr<LogOddsMap>> {
    return fail(ErrorCode::kPlugin, "no CUDA device can be used", "CUDA device 0");
  };
}

TEST(VoxelGridCudaFallback, NoDeviceIsAnErrorThatNamesTheWayOut) {
  TestHost host;
  const auto made = create(room_options(0.1), host.context(), no_device());
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kPlugin);
  EXPECT_NE(made.error().hint.find("fallback: cpu"), std::string::npos);
}

TEST(VoxelGridCudaFallback, RunsWithoutADevice) {
  TestHost host;
  Options options = room_options(0.1);
  options.fallback = "cpu";
  const auto made = create(options, host.context(), no_device());
  ASSERT_TRUE(made);
  EXPECT_EQ(host.log().count(LogLevel::kWarning), 1);
  voxel_grid::VoxelGrid cpu(options, host.context());
  for (const Frame& frame : room_frames(2)) {
    ASSERT_TRUE((*made)->integrate(frame));
    ASSERT_TRUE(cpu.integrate(frame));
  }
  EXPECT_EQ(copy_bits(dynamic_cast<const OccupancyView&>(**made)), copy_bits(cpu));
}

TEST(VoxelGridCudaFallback, BeginsAnewWhenTheDeviceIsLost) {
  TestHost host;
  Options options = room_options(0.1);
  options.fallback = "cpu";
  const auto made = create(options, host.context(), lost_after(2));
  ASSERT_TRUE(made);
  auto& mapper = dynamic_cast<VoxelGridCuda&>(**made);
  voxel_grid::VoxelGrid cpu(options, host.context());
  const std::vector<Frame> frames = room_frames(5);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const auto update = mapper.integrate(frames[f]);
    ASSERT_TRUE(update);
    EXPECT_EQ(update->sequence, static_cast<std::int64_t>(f) + 1);
    EXPECT_EQ(update->grid_moved, f == 2);
    EXPECT_EQ(mapper.occupancy_on_device().has_value(), f < 2);
    if (f < 2) continue;
    ASSERT_TRUE(cpu.integrate(frames[f]));
    EXPECT_EQ(copy_bits(mapper), copy_bits(cpu));
  }
  EXPECT_EQ(host.log().count(LogLevel::kWarning), 1);
}

TEST(VoxelGridCudaFallback, ALostDeviceIsAnErrorWithoutIt) {
  TestHost host;
  const auto made = create(room_options(0.1), host.context(), lost_after(1));
  ASSERT_TRUE(made);
  const std::vector<Frame> frames = room_frames(2);
  EXPECT_TRUE((*made)->integrate(frames[0]));
  const auto lost = (*made)->integrate(frames[1]);
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::kPlugin);
}

TEST(VoxelGridCudaMemory, MoreThanTheDeviceHasIsAnError) {
  TestHost host;
  const auto made = create({}, host.context(), [](const MapSettings& settings) {
    return make_host_map(settings, HostBackend(Order::kForward, std::size_t{16} << 20));
  });
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kUnsupported);
}

}  // namespace
}  // namespace sidestep::voxel_grid_cuda

namespace sidestep::conformance {

// Sizes that fill no block and no word, so that the last ones are partly outside.
INSTANTIATE_TEST_SUITE_P(voxel_grid_cuda, MapperConformance,
                         testing::Values(voxel_grid_cuda::gpu_mapper_case("projective",
                                                                          {90, 71, 45}),
                                         voxel_grid_cuda::gpu_mapper_case("raycast", {90, 71, 45}),
                                         voxel_grid_cuda::gpu_mapper_case("auto", {128, 64, 48})),
                         [](const auto& test) { return test.param.name; });

}  // namespace sidestep::conformance
