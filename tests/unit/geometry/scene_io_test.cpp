#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>

#include "geometry_testing.hpp"
#include "sidestep/geometry/scene.hpp"

namespace sidestep {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

SceneReading read_text(const std::string& text) {
  std::vector<Error> errors;
  const auto document = parse_yaml(text, "scene.yaml", errors);
  EXPECT_TRUE(errors.empty());
  if (!document) {
    ADD_FAILURE() << document.error().describe();
    return {};
  }
  return read_scene(*document);
}

std::vector<std::string> messages(const SceneReading& reading) {
  std::vector<std::string> texts;
  for (const Error& error : reading.errors) {
    EXPECT_EQ(error.code, ErrorCode::kConfig);
    texts.push_back(error.describe());
  }
  return texts;
}

TEST(ReadScene, ReadsEveryShapeAndBothKindsOfPose) {
  const SceneReading reading = read_text(R"(
objects:
  - name: floor
    shape: plane
  - name: slope
    shape: {half_space: {}}
    pose: {rpy_rad: [0.1, 0, 0]}
  - name: crate
    shape: {box: {size_m: [1, 2, 3]}}
    pose: {xyz_m: [4, 5, 6], rpy_rad: [0, 0, 1.5]}
  - name: ball
    shape: {sphere: {radius_m: 0.5}}
  - name: pole
    shape: {cylinder: {radius_m: 0.1, length_m: 2}}
  - name: walker
    shape: {capsule: {radius_m: 0.3, length_m: 1.2}}
    waypoints:
      - {time_s: 0, xyz_m: [0, 0, 0.9]}
      - {time_s: 2.5, xyz_m: [3, 0, 0.9], rpy_rad: [0, 0, 1]}
    repeat: true
)");
  ASSERT_THAT(messages(reading), ElementsAre());
  const auto& objects = reading.scene.objects();
  ASSERT_EQ(objects.size(), 6U);
  EXPECT_TRUE(std::holds_alternative<HalfSpace>(objects[0].shape));
  EXPECT_TRUE(std::holds_alternative<HalfSpace>(objects[1].shape));
  EXPECT_EQ(std::get<Box>(objects[2].shape).size_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(
      objects[2].T_world_object(0.0).isApprox(transform_from_xyz_rpy({4, 5, 6}, {0, 0, 1.5})));
  EXPECT_EQ(std::get<Sphere>(objects[3].shape).radius_m, 0.5);
  EXPECT_EQ(std::get<Cylinder>(objects[4].shape).length_m, 2.0);
  EXPECT_EQ(std::get<Capsule>(objects[5].shape).length_m, 1.2);
  EXPECT_EQ(objects[5].name, "walker");
  EXPECT_TRUE(objects[5].repeat);
  ASSERT_EQ(objects[5].waypoints.size(), 2U);
  EXPECT_EQ(objects[5].waypoints[1].time_s, 2.5);
  EXPECT_EQ(objects[5].waypoints[1].T_world_object.translation(), Eigen::Vector3d(3, 0, 0.9));
}

TEST(ReadScene, TellsEveryMistakeInOnePass) {
  const SceneReading reading = read_text(R"(objets: 1
objects:
  - name: a
    shape: {box: {size_m: [1, 0, -2]}}
    pos: {xyz_m: [0, 0, 0]}
  - name: a
    shape: {shpere: {radius_m: 1}}
  - shape: {sphere: {radius_m: .nan, raduis_m: 1}}
  - name: b
    shape: {cylinder: {radius_m: 1}}
    pose: {xyz_m: [0, 0], rpy_rad: [0, zero, 0]}
  - name: c
    shape: {capsule: {radius_m: 1, length_m: 1}}
    waypoints: [{time_s: 1}, {time_s: 1}, {xyz_m: [0, 0, 0]}]
  - name: d
    shape: {mesh: {file: absent.stl, scale: 0}}
    repeat: maybe
  - name: e
    shape: ball
    pose: {}
    waypoints: []
  - nothing
)");
  EXPECT_TRUE(reading.scene.objects().empty());
  EXPECT_THAT(
      messages(reading),
      ElementsAre(
          AllOf(HasSubstr("scene.yaml:1:1: unknown key 'objets'"), HasSubstr("mean 'objects'")),
          AllOf(HasSubstr("scene.yaml:5:5: unknown key 'pos'"), HasSubstr("mean 'pose'")),
          HasSubstr("scene.yaml:4:31: size_m must be greater than 0, found 0"),
          HasSubstr("scene.yaml:4:34: size_m must be greater than 0, found -2"),
          HasSubstr("scene.yaml:6:11: another object is named 'a' already"),
          AllOf(HasSubstr("scene.yaml:7:13: there is no shape 'shpere'"),
                HasSubstr("mean 'sphere'")),
          HasSubstr("scene.yaml:8:5: an object needs the key 'name'"),
          AllOf(HasSubstr("scene.yaml:8:38: unknown key 'raduis_m'"), HasSubstr("'radius_m'")),
          HasSubstr("scene.yaml:8:32: expected a finite number"),
          HasSubstr("scene.yaml:10:23: a cylinder needs the key 'length_m'"),
          HasSubstr("scene.yaml:11:19: expected a list of 3 numbers, found 2"),
          HasSubstr("scene.yaml:11:40: expected a number, found a string 'zero'"),
          HasSubstr("scene.yaml:14:39: time_s must increase"),
          HasSubstr("scene.yaml:14:43: a waypoint needs the key 'time_s'"),
          HasSubstr("scene.yaml:16:45: scale must be greater than 0, found 0"),
          HasSubstr("absent.stl"), HasSubstr("scene.yaml:17:13: expected true or false"),
          AllOf(HasSubstr("scene.yaml:19:12: expected a shape"), HasSubstr("half_space")),
          HasSubstr("scene.yaml:21:16: an object has either a 'pose' or 'waypoints'"),
          HasSubstr("scene.yaml:21:16: expected a list of at least one waypoint"),
          HasSubstr("scene.yaml:22:5: expected an object")));
}

TEST(ReadScene, RefusesWhatIsNoScene) {
  EXPECT_THAT(messages(read_text("[1, 2]")), ElementsAre(HasSubstr("expected a scene")));
  EXPECT_THAT(messages(read_text("{}")), ElementsAre(HasSubstr("needs the key 'objects'")));
  EXPECT_THAT(messages(read_text("objects: 3")), ElementsAre(HasSubstr("list of objects")));
  EXPECT_THAT(messages(read_text("objects: [{name: a, shape: {box: {}, sphere: {}}}]")),
              ElementsAre(HasSubstr("found a map of 2 entries")));
  EXPECT_THAT(messages(read_text("objects: [{name: a, shape: {sphere: }}]")),
              ElementsAre(HasSubstr("needs its sizes")));
  EXPECT_THAT(messages(read_text("objects: [{name: a, shape: plane, repeat: true}]")),
              ElementsAre(HasSubstr("only an object with 'waypoints'")));
}

TEST(ReadScene, ReadsRangesToDrawFrom) {
  const std::string object =
      "objects: [{name: a, shape: {sphere: {radius_m: 1}}, waypoints: [{time_s: 0}, {time_s: 1}], ";
  const SceneReading read =
      read_text(object + "random: {delay_s: [-1, 2], speed: [0.5, 3], z_m: [4, 5]}}]");
  ASSERT_TRUE(read.errors.empty());
  const MotionRanges ranges = read.scene.objects().front().random.value();
  EXPECT_EQ(ranges.delay_s.lower, -1.0);
  EXPECT_EQ(ranges.delay_s.upper, 2.0);
  EXPECT_EQ(ranges.speed.upper, 3.0);
  EXPECT_EQ(ranges.offset_m[0].upper, 0.0);
  EXPECT_EQ(ranges.offset_m[2].lower, 4.0);
  EXPECT_THAT(messages(read_text(object + "random: {delay_s: [2, 1], sped: [1, 1], y_m: 3}}]")),
              ElementsAre(HasSubstr("did you mean 'speed'?"), HasSubstr("delay_s is upside down"),
                          HasSubstr("expected a list")));
  EXPECT_THAT(messages(read_text(object + "random: {speed: [0, 1]}}]")),
              ElementsAre(HasSubstr("a factor of speed must be greater than 0")));
  EXPECT_THAT(messages(read_text("objects: [{name: a, shape: plane, random: {delay_s: [0, 1]}}]")),
              ElementsAre(HasSubstr("only an object with 'waypoints' has a delay_s")));
}

class SceneOfTheProject : public ::testing::TestWithParam<std::string> {
 protected:
  SceneReading read() {
    const auto file =
        std::filesystem::path(SIDESTEP_SOURCE_DIR) / "configs/scenes" / (GetParam() + ".yaml");
    const auto document = YamlDocumentReader().read(file);
    if (!document) {
      ADD_FAILURE() << document.error().describe();
      return {};
    }
    return read_scene(*document);
  }
};

TEST_P(SceneOfTheProject, IsReadWithoutMistakes) {
  const SceneReading reading = read();
  EXPECT_THAT(messages(reading), ElementsAre());
  EXPECT_FALSE(reading.scene.objects().empty());
}

/// Every scene file beside room.yaml, so that none is left unread.
std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const auto& file : std::filesystem::directory_iterator(
           std::filesystem::path(SIDESTEP_SOURCE_DIR) / "configs/scenes")) {
    if (file.path().extension() == ".yaml") names.push_back(file.path().stem().string());
  }
  std::ranges::sort(names);
  return names;
}
INSTANTIATE_TEST_SUITE_P(Each, SceneOfTheProject, ::testing::ValuesIn(scene_names()),
                         [](const auto& suite) { return suite.param; });

class Room : public SceneOfTheProject {};

TEST_P(Room, HasTheFreeFloorAndTheTableThatItsHeaderPromises) {
  const Scene scene = read().scene;
  for (double x = -1.5; x <= 0.1; x += 0.05) {
    for (double y = -2.4; y <= 1.7; y += 0.05) {
      for (double z = 0.02; z <= 2.0; z += 0.1) {
        EXPECT_GT(scene.signed_distance({x, y, z}, 0.0).distance_m, 0.0) << x << ' ' << y;
      }
    }
  }
  const SceneDistance above_table = scene.signed_distance({0.9, 0.3, 0.79}, 0.0);
  EXPECT_NEAR(above_table.distance_m, 0.05, 1e-9);
  EXPECT_EQ(scene.objects()[static_cast<std::size_t>(above_table.object)].name, "table_top");
}
INSTANTIATE_TEST_SUITE_P(OfTheDemo, Room, ::testing::Values("room"));

}  // namespace
}  // namespace sidestep
