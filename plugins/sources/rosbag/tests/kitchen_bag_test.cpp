// The frames of a real Kinect, through a bag and back: the map is the same, bit for bit.

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>

#include "bag_writing.hpp"
#include "conformance/map_bits.hpp"
#include "depth_sequence.hpp"
#include "voxel_grid.hpp"

namespace sidestep::rosbag::testing {
namespace {

const std::filesystem::path kKinectFrames =
    std::filesystem::path(SIDESTEP_SHARED_DATA) / "kinect_kitchen";
constexpr const char* kPoseTopic = "/kinect/pose";

class KitchenInABag : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kKinectFrames)) GTEST_SKIP() << "no frames at " << kKinectFrames;
  }

  std::unique_ptr<Source> sequence(double depth_max_m) {
    depth_sequence::Options options;
    options.path = kKinectFrames;
    options.depth_max_m = depth_max_m;
    return depth_sequence::create_source(options, host_.log(), documents_).value();
  }

  /// The sequence as a robot would record it: depth in the sensor's own mm, and the camera's pose,
  /// a few ms after its image, as the doubles of a TransformStamped.
  void write_bag() {
    constexpr double kEverything_m = 65.5;
    const auto source = sequence(kEverything_m);
    BagWriter bag(file_);
    while (auto frame = source->next(Deadline()).value()) {
      const Stamp stamp{kBegin_ns + frame->stamp.ns};
      const auto& image = std::get<DepthImage>(frame->measurement);
      if (frame->sequence == 0) {
        bag.write("/camera/depth/camera_info", stamp,
                  ros_messages::to_camera_info(image.camera, stamp, "kinect"));
      }
      bag.write("/camera/depth/image", stamp,
                to_image(image, ros_messages::DepthEncoding::k16UC1, stamp, "kinect"));
      bag.write(
          kPoseTopic, Stamp{stamp.ns + 4'000'000},
          to_transform(ros_messages::rigid_pose(frame->T_world_camera), stamp, "world", "kinect"));
    }
  }

  std::unique_ptr<voxel_grid::VoxelGrid> empty_map() {
    voxel_grid::VoxelGridOptions options;
    options.resolution_m = 0.025;
    options.size_vox = {140, 160, 88};
    options.origin_m = {-0.4, -1.6, -0.1};
    return std::make_unique<voxel_grid::VoxelGrid>(options, host_.context());
  }

  testing_support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "kitchen.bag";
  conformance::TestHost host_{2};
  YamlDocumentReader documents_;
};

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

/// Poses are quaternions in a bag and matrices in the sequence: they differ by their rounding. The
/// images are the same, and so is the map.
TEST_F(KitchenInABag, GivesTheMapOfTheFramesThemselves) {
  write_bag();
  Options options = options_of(file_);
  options.pose.from = "topic";
  options.pose.topic = kPoseTopic;
  options.pose.max_gap_s = 0.0;  // every image has a pose of its very stamp
  auto from_bag = create_source(options, host_.context());
  ASSERT_TRUE(from_bag) << from_bag.error().describe();
  const auto direct = sequence(options.depth_max_m);
  const auto bag_map = empty_map();
  const auto direct_map = empty_map();
  int frames = 0;
  while (auto expected = direct->next(Deadline()).value()) {
    auto frame = (*from_bag)->next(Deadline());
    ASSERT_TRUE(frame) << frame.error().describe();
    ASSERT_TRUE(*frame);
    ++frames;
    ASSERT_TRUE(same_bits(std::get<DepthImage>((*frame)->measurement).depth_m,
                          std::get<DepthImage>(expected->measurement).depth_m));
    EXPECT_EQ((*frame)->T_world_camera.matrix(),
              ros_messages::rigid_pose(expected->T_world_camera).transform().matrix());
    const Eigen::Matrix4d off =
        (*frame)->T_world_camera.matrix() - expected->T_world_camera.matrix();
    EXPECT_LT(off.cwiseAbs().maxCoeff(), 1e-15 * 8);
    ASSERT_TRUE(bag_map->integrate(**frame));
    ASSERT_TRUE(direct_map->integrate(*expected));
  }
  EXPECT_EQ(frames, 300);
  EXPECT_FALSE((*from_bag)->next(Deadline()).value()) << "no frame more, and no damage";
  EXPECT_EQ(conformance::copy_bits(*bag_map), conformance::copy_bits(*direct_map));
  const GridSpec& grid = bag_map->grid();
  std::int64_t different = 0;
  std::int64_t touched = 0;
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    for (int y = 0; y < grid.size_vox.y(); ++y) {
      for (int x = 0; x < grid.size_vox.x(); ++x) {
        const double log_odds = bag_map->log_odds({x, y, z});
        touched += log_odds != 0.0 ? 1 : 0;
        different += log_odds != direct_map->log_odds({x, y, z}) ? 1 : 0;
      }
    }
  }
  EXPECT_EQ(different, 0) << "of " << touched << " voxels that were seen";
  EXPECT_GT(touched, 100'000);
}

}  // namespace
}  // namespace sidestep::rosbag::testing
