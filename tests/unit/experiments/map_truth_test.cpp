#include <sidestep/measures/map_truth.hpp>

#include <gtest/gtest.h>

#include "conformance/grid_map.hpp"

namespace sidestep {
namespace {

using conformance::GridMap;

constexpr double kVoxel_m = 0.1;

/// A camera at the origin that looks along x at a wall 3 m away; a cube of 0.6 m crosses half way
/// from y = -3 to 3 m in 6 s, and rests there.
class MapTruthTest : public testing::Test {
 protected:
  static Scene make_scene() {
    Transform wall = Transform::Identity(), left = Transform::Identity(),
              right = Transform::Identity();
    wall.translation() = Eigen::Vector3d(3.05, 0.0, 0.0);
    left.translation() = Eigen::Vector3d(1.55, -3.0, 0.0);
    right.translation() = Eigen::Vector3d(1.55, 3.0, 0.0);
    return Scene({{"wall", Box{{0.1, 12.0, 12.0}}, {{0.0, wall}}, false},
                  {"cube", Box{{0.6, 0.6, 0.6}}, {{0.0, left}, {6.0, right}}, false}});
  }

  /// What a perfect camera sees at a time.
  Frame look(double time_s) {
    Frame frame;
    frame.stamp = Stamp::from_seconds(time_s);
    frame.T_world_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    DepthImage image{{120, 90, 60.0, 60.0, 59.5, 44.5}, {}};
    RayCaster caster(scene_);
    caster.set_time(time_s);
    std::vector<Eigen::Vector3d> origins, directions;
    for (int v = 0; v < 90; ++v) {
      for (int u = 0; u < 120; ++u) {
        origins.emplace_back(Eigen::Vector3d::Zero());
        directions.emplace_back(frame.T_world_camera.linear() *
                                image.camera.unproject(u, v, 1.0).normalized());
      }
    }
    std::vector<RayHit> hits(origins.size());
    caster.cast(origins, directions, hits);
    for (std::size_t i = 0; i < hits.size(); ++i) {
      image.depth_m.push_back(static_cast<float>(hits[i].distance_m * directions[i].x()));
    }
    frame.measurement = std::move(image);
    return frame;
  }

  /// Occupies or frees the voxels of the cube's near face where it is at a time.
  void set_face(double time_s, bool occupied) {
    const double y = std::min(3.0, -3.0 + time_s);
    for (double dy = -0.25; dy < 0.3; dy += kVoxel_m) {
      for (double dz = -0.25; dz < 0.3; dz += kVoxel_m) {
        const Eigen::Vector3i voxel = grid_.voxel_at({1.3, y + dy, dz});
        if (grid_.contains(voxel)) map_.set(voxel, occupied);
      }
    }
  }
  void set_wall(double y_from, double y_to) {
    for (double y = y_from + 0.05; y < y_to; y += kVoxel_m) {
      for (double z = -1.95; z < 2.0; z += kVoxel_m) map_.set(grid_.voxel_at({3.05, y, z}), true);
    }
  }
  TruthRecord finish() const { return truth_.finish(map_); }

  GridSpec grid_{{0.0, -2.0, -2.0}, kVoxel_m, {40, 40, 40}};
  Scene scene_ = make_scene();
  GridMap map_{grid_};
  MapTruth truth_{scene_, grid_, {.pixel_stride = 2, .min_z_m = -10.0, .max_range_m = 5.0}};
};

TEST_F(MapTruthTest, FindsAWallThatIsWhollyMapped) {
  set_wall(-2.0, 2.0);
  truth_.observe(look(0.0), map_);
  const TruthRecord record = finish();
  EXPECT_GT(record.surface_vox, 800);
  EXPECT_EQ(record.collision_recall(), 1.0);
  EXPECT_EQ(record.false_vox, 0);
  EXPECT_EQ(record.occupied_vox, 1600);
  EXPECT_EQ(record.ghost_vox, 0);
}

TEST_F(MapTruthTest, MissesTheHalfThatIsNotMapped) {
  set_wall(-2.0, 0.0);
  truth_.observe(look(0.0), map_);
  // One voxel beyond the middle counts as found.
  EXPECT_NEAR(*finish().collision_recall(), 0.5, 0.05);
}

TEST_F(MapTruthTest, CountsObstaclesThatAreNotThere) {
  set_wall(-2.0, 2.0);
  map_.set(grid_.voxel_at({0.65, 0.05, 0.05}), true);
  map_.set(grid_.voxel_at({2.05, 0.05, 0.05}), true);
  map_.set(grid_.voxel_at({2.95, 0.05, 0.05}), true);  // one voxel before the wall
  truth_.observe(look(0.0), map_);
  EXPECT_EQ(finish().false_vox, 2);
}

TEST_F(MapTruthTest, SaysNothingOfPixelsWithoutMeasurement) {
  Frame frame = look(0.0);
  for (float& depth_m : std::get<DepthImage>(frame.measurement).depth_m) depth_m = 0.0F;
  truth_.observe(frame, map_);
  EXPECT_EQ(finish().collision_recall(), std::nullopt);
}

TEST_F(MapTruthTest, CountsFramesUntilAnObjectAppears) {
  for (const double time_s : {2.5, 2.6, 2.7}) {
    if (time_s > 2.65) set_face(time_s, true);
    truth_.observe(look(time_s), map_);
  }
  const TruthRecord record = finish();
  EXPECT_EQ(record.appear_frames, std::vector<double>{3.0});
  EXPECT_EQ(record.never_appeared, 0);
}

TEST_F(MapTruthTest, TellsOfAnObjectThatNeverAppears) {
  for (const double time_s : {2.5, 2.6, 2.7, 6.0}) truth_.observe(look(time_s), map_);
  EXPECT_TRUE(finish().appear_frames.empty());
  EXPECT_EQ(finish().never_appeared, 1);
}

TEST_F(MapTruthTest, CountsFramesOfSeeingThroughUntilAVoxelIsGone) {
  set_face(3.0, true);
  truth_.observe(look(3.0), map_);
  truth_.observe(look(6.0), map_);  // it has left: seen through once
  truth_.observe(look(6.1), map_);
  set_face(3.0, false);
  truth_.observe(look(6.2), map_);
  const TruthRecord record = finish();
  EXPECT_EQ(record.gone_frames, std::vector<double>(36, 3.0));
  EXPECT_EQ(record.ghost_vox, 0);
}

TEST_F(MapTruthTest, CountsGhostsThatAreLeft) {
  set_face(3.0, true);
  truth_.observe(look(3.0), map_);
  for (int i = 0; i < 8; ++i) truth_.observe(look(6.0 + 0.1 * i), map_);
  const TruthRecord record = finish();
  EXPECT_TRUE(record.gone_frames.empty());
  EXPECT_EQ(record.ghost_vox, 36);
  EXPECT_EQ(record.ghost_seen_vox, 36);
  EXPECT_EQ(record.false_vox, 36);
}

TEST_F(MapTruthTest, DoesNotBlameAMapForWhatCannotBeSeenThrough) {
  set_face(3.0, true);
  truth_.observe(look(3.0), map_);
  Frame away = look(6.0);
  away.T_world_camera.linear() = -away.T_world_camera.linear();
  away.T_world_camera.linear().col(0) *= -1.0;
  truth_.observe(away, map_);
  EXPECT_EQ(finish().ghost_vox, 36);
  EXPECT_EQ(finish().ghost_seen_vox, 0);
}

}  // namespace
}  // namespace sidestep
