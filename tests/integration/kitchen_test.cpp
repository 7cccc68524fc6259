// The kitchen that a real Kinect saw, through the shipped configurations: the map against what was
// measured of the room by hand (data set's world.yaml), and both plans.

#include <cstdlib>
#include <map>

#include <gtest/gtest.h>

#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/sensor_check.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/pipeline.hpp>
#include <sidestep/runtime/planning_settings.hpp>

#include "support/host_fixture.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

const std::filesystem::path kKitchen =
    std::filesystem::path(SIDESTEP_SHARED_DATA) / "kinect_kitchen";

/// A box in the measured room.
struct Region {
  Eigen::Vector3d lower_m;
  Eigen::Vector3d upper_m;
};

class Kitchen : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kKitchen)) GTEST_SKIP() << "no data at " << kKitchen;
  }

  static std::string configuration() {
    return std::string(SIDESTEP_SOURCE_DIR) + "/configs/" + GetParam() + ".yaml";
  }
  /// All frames with voxel_grid, every tenth with OctoMap, which takes a second for each.
  static std::string stride() {
    return std::string(GetParam()) == "kitchen_hsr_gp" ? "source.stride=1" : "source.stride=10";
  }

  /// Calls visit(voxel) for the voxels whose centres lie in a region.
  template <class Visit>
  static void for_each(const GridSpec& grid, const Region& region, Visit&& visit) {
    const Eigen::Vector3i from = grid.voxel_at(region.lower_m);
    const Eigen::Vector3i to = grid.voxel_at(region.upper_m);
    for (int z = from.z(); z <= to.z(); ++z) {
      for (int y = from.y(); y <= to.y(); ++y) {
        for (int x = from.x(); x <= to.x(); ++x) visit(Eigen::Vector3i(x, y, z));
      }
    }
  }
};

TEST_P(Kitchen, TheMapHasTheTableWhereItWasMeasuredAndTheFloorFree) {
  testing_support::HostFixture fixture({PLUGIN_FOLDER});
  const auto reading = read_configuration(
      configuration(), {"source.path=" + kKitchen.string(), stride()}, fixture.documents);
  ASSERT_TRUE(reading.errors.empty()) << reading.errors.front().describe();
  const Node& root = reading.configuration.root;
  auto source = fixture.host.create<Source>(*root.find("source"));
  auto mapper = fixture.host.create<Mapper>(*root.find("mapper"));
  auto field = fixture.host.create<FieldBuilder>(*root.find("field"));
  ASSERT_TRUE(source) << source.error().describe();
  ASSERT_TRUE(mapper) << mapper.error().describe();
  ASSERT_TRUE(field) << field.error().describe();
  SnapshotSlot slot;
  MappingPipeline pipeline({**source, **mapper, **field, slot, fixture.log});
  ASSERT_TRUE(pipeline.attach());
  int frames = 0;
  for (;; ++frames) {
    const auto step = pipeline.step({});
    ASSERT_TRUE(step) << step.error().describe();
    if (!*step) break;
  }
  EXPECT_EQ(frames, std::string(GetParam()) == "kitchen_hsr_gp" ? 300 : 30);
  EXPECT_TRUE(pipeline.bad_frames().empty());

  const auto* view = dynamic_cast<const OccupancyView*>(mapper->get());
  ASSERT_NE(view, nullptr);
  const GridSpec& grid = view->occupancy_grid();

  // world.yaml: the table's top at z = 0.713 m, over x 1.2..2.0, y -1.1..0.95.
  std::map<int, int> occupied_by_layer;
  for_each(grid, {{1.3, -0.9, 0.5}, {1.9, 0.7, 0.95}}, [&](const Eigen::Vector3i& voxel) {
    if (view->occupied().at(grid, voxel)) ++occupied_by_layer[voxel.z()];
  });
  int top = 0;
  for (const auto& [layer, count] : occupied_by_layer) {
    if (count > occupied_by_layer[top]) top = layer;
  }
  EXPECT_NEAR(grid.centre_m({0, 0, top}).z(), 0.713, grid.resolution_m);

  // The floor between table and counter, up to a hand's breadth above it.
  int seen = 0;
  for_each(grid, {{0.9, 1.15, -0.05}, {1.35, 1.5, 0.15}}, [&](const Eigen::Vector3i& voxel) {
    EXPECT_FALSE(view->occupied().at(grid, voxel)) << grid.centre_m(voxel).transpose();
    seen += view->known().at(grid, voxel) ? 1 : 0;
  });
  EXPECT_GT(seen, 100) << "the camera looked at this floor";
}

TEST_P(Kitchen, TheStraightWayIsBlockedByWhatTheCameraSaw) {
  testing_support::HostFixture fixture({PLUGIN_FOLDER});
  const auto reading = read_configuration(
      configuration(),
      {"source.path=" + kKitchen.string(), "source.stride=10",
       "robot.profile=" + std::string(SIDESTEP_SOURCE_DIR) + "/robots/hsr/profile.yaml"},
      fixture.documents);
  ASSERT_TRUE(reading.errors.empty()) << reading.errors.front().describe();
  const Node& root = reading.configuration.root;
  auto source = fixture.host.create<Source>(*root.find("source"));
  auto mapper = fixture.host.create<Mapper>(*root.find("mapper"));
  auto field = fixture.host.create<FieldBuilder>(*root.find("field"));
  auto own_robot = fixture.host.create<RobotModel>(*root.find("robot"));
  ASSERT_TRUE(source && mapper && field);
  ASSERT_TRUE(own_robot) << own_robot.error().describe();
  const std::shared_ptr<const RobotModel> robot = std::move(*own_robot);
  SnapshotSlot slot;
  MappingPipeline pipeline({**source, **mapper, **field, slot, fixture.log});
  ASSERT_TRUE(pipeline.attach());
  for (auto step = pipeline.step({}); step && *step;) step = pipeline.step({});

  const Node& plan = root.find("experiment")->find("plans")->items().front();
  std::vector<Error> errors;
  const auto start = read_robot_state(*plan.find("start"), robot->description(), errors);
  const auto goal = read_robot_state(*plan.find("goal"), robot->description(), errors);
  ASSERT_TRUE(errors.empty());
  const auto at = [&](double fraction, double margin_m) {
    const Eigen::VectorXd q = start + fraction * (goal - start);
    return state_violation(robot, slot.pin(), {Space::kFree, Space::kOccupied, {}}, margin_m,
                           {q.data(), static_cast<std::size_t>(q.size())});
  };
  constexpr double kSpare_m = 0.08;
  EXPECT_FALSE(at(0.0, kSpare_m)) << at(0.0, kSpare_m)->what();
  EXPECT_FALSE(at(1.0, kSpare_m)) << at(1.0, kSpare_m)->what();
  double deepest_m = 0.0;
  for (double fraction = 0.0; fraction <= 1.0; fraction += 0.02) {
    const auto hit = at(fraction, 0.0);
    if (hit && hit->kind == Violation::Kind::kCollision)
      deepest_m = std::max(deepest_m, hit->amount);
  }
  EXPECT_GT(deepest_m, 0.02);  // a field without sign has no more than the radius of a finger
}

TEST_P(Kitchen, ThePlanPassesBothChecks) {
  const testing_support::TemporaryFolder folder;
  const std::string out = (folder.path() / "run").string();
  const std::string command = std::string(SIDESTEP_COMMAND) + " run " + configuration() +
                              " --set source.path=" + kKitchen.string() + " --set " + stride() +
                              " --out " + out + " >/dev/null 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
}

/// The other optimiser of the same problem, in the map of fewer frames.
TEST(KitchenByName, CeresPlansAsWell) {
  if (!std::filesystem::exists(kKitchen)) GTEST_SKIP() << "no data at " << kKitchen;
  const testing_support::TemporaryFolder folder;
  const std::string command =
      std::string(SIDESTEP_COMMAND) + " run " + SIDESTEP_SOURCE_DIR +
      "/configs/kitchen_hsr_gp.yaml --set source.path=" + kKitchen.string() +
      " --set source.stride=10 --set optimiser.plugin=gp_ceres --out " +
      (folder.path() / "run").string() + " >/dev/null 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
}

/// A real camera, mounted as said; and as if it were mounted five degrees off.
TEST_P(Kitchen, TheCameraIsFoundSoundAndATiltedOneIsNot) {
  testing_support::HostFixture fixture({PLUGIN_FOLDER});
  const auto reading = read_configuration(
      configuration(), {"source.path=" + kKitchen.string(), stride()}, fixture.documents);
  ASSERT_TRUE(reading.errors.empty());
  auto source = fixture.host.create<Source>(*reading.configuration.root.find("source"));
  ASSERT_TRUE(source) << source.error().describe();
  SensorCheck sound(0.0), tilted(0.0);
  int frames = 0, noticed = 0;
  for (;; ++frames) {
    const auto next = (*source)->next({});
    ASSERT_TRUE(next) << next.error().describe();
    if (!*next) break;
    const auto checked = sound.check(**next);
    EXPECT_TRUE(checked) << frames << ": " << checked.error().describe();
    Frame off = **next;
    off.T_world_camera =
        off.T_world_camera * transform_from_xyz_rpy(Eigen::Vector3d::Zero(), {0.0873, 0.0, 0.0});
    const auto found = tilted.check(off);
    if (!found && found.error().message.find("tilted") != std::string::npos) ++noticed;
  }
  RecordProperty("frames", frames);
  RecordProperty("noticed", noticed);
  EXPECT_GT(noticed, frames / 4);
}

INSTANTIATE_TEST_SUITE_P(recorded, Kitchen, testing::Values("kitchen_hsr_gp", "kitchen_hsr_ompl"),
                         [](const testing::TestParamInfo<const char*>& tested) {
                           return std::string(tested.param);
                         });

}  // namespace
}  // namespace sidestep
