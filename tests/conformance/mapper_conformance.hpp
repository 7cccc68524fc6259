#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

#include "map_bits.hpp"

/// What every mapper must do, as tests that run on yours. In one .cpp of a test program:
///
///     INSTANTIATE_TEST_SUITE_P(my_mapper, MapperConformance, testing::Values(
///         MapperCase{"default", [](WorkerPool& workers) { return ...; }}));
///
/// The frames fit the mapper's own grid: a wall across it, seen from inside. The grid must be
/// at least 16 voxels wide each way, range limits must allow for half its diagonal, and a floor
/// rule must leave the upper half of the grid alone.
namespace sidestep::conformance {

struct MapperCase {
  std::string name;
  /// A new mapper that works with these threads. `workers` outlives it.
  std::function<std::shared_ptr<Mapper>(WorkerPool& workers)> create;
  /// Whether point clouds are integrated; depth images always are.
  bool takes_clouds = true;
};

inline void PrintTo(const MapperCase& mapper, std::ostream* out) { *out << mapper.name; }

/// A wall facing the camera, seen from the middle of the upper half of a grid.
class WallScene {
 public:
  explicit WallScene(const GridSpec& grid) : grid_(grid) {
    const Eigen::Vector3d size_m = grid.size_vox.cast<double>() * grid.resolution_m;
    eye_m_ = grid.origin_m + size_m.cwiseProduct(Eigen::Vector3d(0.25, 0.5, 0.75));
    wall_x_ = grid.size_vox.x() * 5 / 8;
    wall_x_m_ = grid.origin_m.x() + (wall_x_ + 0.5) * grid.resolution_m;
    camera_ = {96, 72, 88.0, 88.0, 47.5, 35.5};
  }

  /// x of the wall's voxel layer.
  [[nodiscard]] int wall_x() const noexcept { return wall_x_; }
  [[nodiscard]] const Eigen::Vector3d& eye_m() const noexcept { return eye_m_; }
  /// The wall's voxel straight ahead of the camera.
  [[nodiscard]] Eigen::Vector3i ahead() const {
    return grid_.voxel_at({wall_x_m_, eye_m_.y(), eye_m_.z()});
  }

  /// The wall `shift_vox` voxels farther away, with a dent, so that frames differ.
  [[nodiscard]] Frame frame(std::int64_t sequence, int shift_vox = 0) const {
    Frame frame = empty(sequence);
    DepthImage image{camera_, {}};
    const double depth_m = wall_x_m_ + shift_vox * grid_.resolution_m - eye_m_.x();
    for (int v = 0; v < camera_.height_px; ++v) {
      for (int u = 0; u < camera_.width_px; ++u) {
        const bool dent = u < 20 && v < 20;
        image.depth_m.push_back(static_cast<float>(dent ? 0.7 * depth_m : depth_m));
      }
    }
    frame.measurement = std::move(image);
    return frame;
  }

  [[nodiscard]] Frame cloud_frame(std::int64_t sequence, int shift_vox = 0) const {
    Frame frame = this->frame(sequence, shift_vox);
    const DepthImage image = std::get<DepthImage>(frame.measurement);
    PointCloud cloud;
    for (int v = 0; v < camera_.height_px; ++v) {
      for (int u = 0; u < camera_.width_px; ++u) {
        const double depth_m = static_cast<double>(image.at(u, v));
        cloud.points_m.push_back(camera_.unproject(u, v, depth_m).cast<float>());
      }
    }
    frame.measurement = std::move(cloud);
    return frame;
  }

  /// Looks along +x of the world; no measurement yet.
  [[nodiscard]] Frame empty(std::int64_t sequence) const {
    Frame frame;
    frame.sequence = sequence;
    frame.stamp = Stamp{sequence * 33'000'000};
    frame.T_world_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    frame.T_world_camera.translation() = eye_m_;
    return frame;
  }

 private:
  GridSpec grid_;
  CameraIntrinsics camera_;
  Eigen::Vector3d eye_m_;
  int wall_x_ = 0;
  double wall_x_m_ = 0.0;
};

class MapperConformance : public testing::TestWithParam<MapperCase> {
 protected:
  [[nodiscard]] std::shared_ptr<Mapper> create() { return GetParam().create(workers_); }

  /// Null, and a visible skip by the caller, where the mapper offers no dense occupancy.
  [[nodiscard]] static const OccupancyView* view_of(const Mapper& mapper) {
    return dynamic_cast<const OccupancyView*>(&mapper);
  }

  static MapUpdate must_integrate(Mapper& mapper, const Frame& frame) {
    auto update = mapper.integrate(frame);
    if (!update) {
      ADD_FAILURE() << update.error().describe();
      return {};
    }
    return *update;
  }

  /// Integrating must fail with kBadFrame, name the frame, and change nothing.
  static void expect_refused(Mapper& mapper, Frame frame, const std::string& what) {
    SCOPED_TRACE(what);
    frame.sequence = 4711;
    const OccupancyView* view = view_of(mapper);
    const MapBits before = view != nullptr ? copy_bits(*view) : MapBits{};
    const auto update = mapper.integrate(frame);
    ASSERT_FALSE(update.has_value());
    EXPECT_EQ(update.error().code, ErrorCode::kBadFrame);
    EXPECT_NE(update.error().describe().find("4711"), std::string::npos)
        << "the error does not name the frame: " << update.error().describe();
    EXPECT_FALSE(update.error().message.empty());
    if (view != nullptr) {
      EXPECT_EQ(copy_bits(*view), before);
    }
  }

 private:
  WorkerPool workers_{2};
};

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(MapperConformance);

TEST_P(MapperConformance, GridIsUsableAndStartsUnknown) {
  const auto mapper = create();
  ASSERT_NE(mapper, nullptr);
  EXPECT_GT(mapper->grid().resolution_m, 0.0);
  EXPECT_TRUE((mapper->grid().size_vox.array() >= kBlockSide_vox).all());
  const OccupancyView* view = view_of(*mapper);
  if (view == nullptr) GTEST_SKIP() << "offers no OccupancyView";
  EXPECT_EQ(view->occupancy_grid(), mapper->grid());
  for (const VoxelBits bits : {view->occupied(), view->known()}) {
    EXPECT_EQ(bits.words_per_row, (mapper->grid().size_vox.x() + 63) / 64);
    EXPECT_EQ(bits.words.size(), static_cast<std::size_t>(bits.words_per_row) *
                                     static_cast<std::size_t>(mapper->grid().size_vox.y()) *
                                     static_cast<std::size_t>(mapper->grid().size_vox.z()));
    for (const std::uint64_t word : bits.words) ASSERT_EQ(word, 0U);
  }
}

TEST_P(MapperConformance, WallIsOccupiedAndSpaceBeforeItFree) {
  const auto mapper = create();
  const WallScene scene(mapper->grid());
  for (int f = 0; f < 3; ++f) must_integrate(*mapper, scene.frame(f));
  const OccupancyView* view = view_of(*mapper);
  if (view == nullptr) GTEST_SKIP() << "offers no OccupancyView";
  const Eigen::Vector3i wall = scene.ahead();
  EXPECT_TRUE(view->occupied().at(mapper->grid(), wall));
  for (int x = wall.x() - 2; x > mapper->grid().voxel_at(scene.eye_m()).x() + 1; --x) {
    const Eigen::Vector3i voxel(x, wall.y(), wall.z());
    EXPECT_FALSE(view->occupied().at(mapper->grid(), voxel)) << voxel.transpose();
    EXPECT_TRUE(view->known().at(mapper->grid(), voxel)) << voxel.transpose();
  }
  for (int x = wall.x() + 2; x < mapper->grid().size_vox.x(); ++x) {
    const Eigen::Vector3i voxel(x, wall.y(), wall.z());
    EXPECT_FALSE(view->known().at(mapper->grid(), voxel)) << voxel.transpose();
  }
}

TEST_P(MapperConformance, OccupiedIsKnownAndPaddingIsZero) {
  const auto mapper = create();
  const WallScene scene(mapper->grid());
  const OccupancyView* view = view_of(*mapper);
  if (view == nullptr) GTEST_SKIP() << "offers no OccupancyView";
  for (int f = 0; f < 4; ++f) {
    must_integrate(*mapper, scene.frame(f, f % 2 * 3));
    const MapBits bits = copy_bits(*view);
    const int used = mapper->grid().size_vox.x() % 64;
    const std::size_t words = static_cast<std::size_t>(view->known().words_per_row);
    for (std::size_t w = 0; w < bits.known.size(); ++w) {
      ASSERT_EQ(bits.occupied[w] & ~bits.known[w], 0U) << "occupied but not known";
      if (used != 0 && w % words == words - 1) {
        ASSERT_EQ(bits.known[w] >> used, 0U) << "bits set beyond the row's end";
      }
    }
  }
}

TEST_P(MapperConformance, ChangedBlocksAreExact) {
  const auto mapper = create();
  const WallScene scene(mapper->grid());
  const OccupancyView* view = view_of(*mapper);
  MapBits before = view != nullptr ? copy_bits(*view) : MapBits{};
  const int shifts[] = {0, 0, 0, 2, 2, 2, 2, 2, 2, 2, -3, -3, 0};
  std::int64_t sequence = 0;
  for (const int shift : shifts) {
    const MapUpdate update = must_integrate(*mapper, scene.frame(sequence, shift));
    EXPECT_EQ(update.sequence, ++sequence);
    EXPECT_EQ(update.stamp, scene.empty(sequence - 1).stamp);
    for (std::size_t b = 0; b < update.changed_blocks.size(); ++b) {
      EXPECT_GE(update.changed_blocks[b], 0);
      EXPECT_LT(update.changed_blocks[b], block_counts(mapper->grid()).prod());
      if (b > 0) {
        EXPECT_LT(update.changed_blocks[b - 1], update.changed_blocks[b]);
      }
    }
    if (view == nullptr) continue;
    MapBits after = copy_bits(*view);
    EXPECT_EQ(update.changed_blocks, differing_blocks(mapper->grid(), before, after))
        << "frame " << sequence - 1;
    before = std::move(after);
  }
}

TEST_P(MapperConformance, EveryPointIsCountedOnce) {
  const auto mapper = create();
  const WallScene scene(mapper->grid());
  Frame frame = scene.frame(0);
  auto& depth_m = std::get<DepthImage>(frame.measurement).depth_m;
  depth_m[100] = 0.0F;
  depth_m[3000] = std::numeric_limits<float>::quiet_NaN();
  depth_m[3001] = std::numeric_limits<float>::infinity();
  depth_m[3002] = -1.0F;
  const auto pixels = static_cast<std::int64_t>(depth_m.size());
  const IntegrationCounts counts = must_integrate(*mapper, frame).counts;
  EXPECT_EQ(counts.invalid, 4);
  EXPECT_EQ(counts.points, pixels - 4);
  EXPECT_EQ(
      counts.inserted + counts.floor + counts.self + counts.out_of_range + counts.outside_grid,
      counts.points);
  EXPECT_GT(counts.inserted, 0);
}

TEST_P(MapperConformance, BadFramesLeaveTheMapUnchanged) {
  const auto mapper = create();
  const WallScene scene(mapper->grid());
  must_integrate(*mapper, scene.frame(0));
  const auto image_of = [](Frame& frame) -> DepthImage& {
    return std::get<DepthImage>(frame.measurement);
  };
  Frame frame = scene.frame(1, -4);
  image_of(frame).depth_m.pop_back();
  expect_refused(*mapper, frame, "one depth too few");
  frame = scene.frame(1, -4);
  image_of(frame).depth_m.clear();
  expect_refused(*mapper, frame, "no depths");
  frame = scene.frame(1, -4);
  image_of(frame).camera.width_px = 0;
  image_of(frame).depth_m.clear();
  expect_refused(*mapper, frame, "zero-sized image");
  frame = scene.frame(1, -4);
  image_of(frame).camera.height_px = -72;
  expect_refused(*mapper, frame, "negative height");
  for (const double focal_px : {0.0, -88.0, std::nan(""), HUGE_VAL}) {
    frame = scene.frame(1, -4);
    image_of(frame).camera.fx_px = focal_px;
    expect_refused(*mapper, frame, "focal length " + std::to_string(focal_px));
  }
  frame = scene.frame(1, -4);
  frame.T_world_camera.translation().y() = std::nan("");
  expect_refused(*mapper, frame, "pose with NaN");
  frame = scene.frame(1, -4);
  frame.T_world_camera.linear() *= 1.1;
  expect_refused(*mapper, frame, "scaled rotation");
  frame = scene.frame(1, -4);
  frame.T_world_camera.linear().col(0) *= -1.0;
  expect_refused(*mapper, frame, "mirroring rotation");
  EXPECT_EQ(must_integrate(*mapper, scene.frame(2)).sequence, 2) << "bad frames do not count";
}

TEST_P(MapperConformance, SameResultOnAnyNumberOfThreads) {
  std::vector<MapBits> results;
  std::vector<std::vector<std::int32_t>> changes;
  for (const int threads : {1, 2, 4}) {
    WorkerPool workers(threads);
    const auto mapper = GetParam().create(workers);
    const WallScene scene(mapper->grid());
    std::vector<std::int32_t> changed;
    for (int f = 0; f < 4; ++f) {
      const MapUpdate update = must_integrate(*mapper, scene.frame(f, f));
      changed.insert(changed.end(), update.changed_blocks.begin(), update.changed_blocks.end());
    }
    changes.push_back(std::move(changed));
    if (const OccupancyView* view = view_of(*mapper)) results.push_back(copy_bits(*view));
  }
  EXPECT_EQ(changes[0], changes[1]);
  EXPECT_EQ(changes[0], changes[2]);
  if (results.empty()) GTEST_SKIP() << "offers no OccupancyView";
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

TEST_P(MapperConformance, CameraThatSeesNothingOfTheGridChangesNothing) {
  const auto mapper = create();
  const WallScene scene(mapper->grid());
  Frame frame = scene.frame(0);
  const double extent_m = mapper->grid().size_vox.maxCoeff() * mapper->grid().resolution_m;
  frame.T_world_camera.translation().x() += 3.0 * extent_m;
  const MapUpdate update = must_integrate(*mapper, frame);
  EXPECT_TRUE(update.changed_blocks.empty());
  EXPECT_EQ(update.counts.inserted, 0);
}

TEST_P(MapperConformance, TakesPointClouds) {
  if (!GetParam().takes_clouds) GTEST_SKIP() << "takes depth images only";
  const auto mapper = create();
  const WallScene scene(mapper->grid());
  for (int f = 0; f < 3; ++f) must_integrate(*mapper, scene.cloud_frame(f));
  Frame frame = scene.empty(3);
  PointCloud cloud;
  cloud.points_m.emplace_back(std::nanf(""), 0.0F, 1.0F);
  frame.measurement = cloud;
  EXPECT_EQ(must_integrate(*mapper, frame).counts.invalid, 1);
  frame.measurement = PointCloud{};
  EXPECT_TRUE(must_integrate(*mapper, frame).changed_blocks.empty());
  const OccupancyView* view = view_of(*mapper);
  if (view == nullptr) GTEST_SKIP() << "offers no OccupancyView";
  EXPECT_TRUE(view->occupied().at(mapper->grid(), scene.ahead()));
}

}  // namespace sidestep::conformance
