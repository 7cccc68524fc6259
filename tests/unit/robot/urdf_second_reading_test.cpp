#include "urdf_second_reading.hpp"

#include <fstream>
#include <functional>
#include <iterator>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.hpp"

namespace sidestep::urdf_robot {
namespace {

using ::testing::HasSubstr;

constexpr const char* kUrdf = R"(<?xml version="1.0"?>
<!-- <link name="no"><collision/></link> -->
<robot name="r">
  <link name='tray'>
    <visual><geometry><sphere radius="9"/></geometry></visual>
    <collision><origin xyz=" 0.1  -2e-1 +3" rpy="0.1 0.2 0.3"/><geometry><box size="0.3 0.9 0.02"/></geometry></collision>
    <collision name="a > b"><geometry><cylinder length = "0.5"
      radius='0.1'/></geometry></collision>
    <collision><geometry><sphere radius="0.25"></sphere></geometry></collision>
    <collision><geometry><mesh filename="a&amp;b.stl" scale="1 -1 2"/></geometry></collision>
  </link>
</robot>
)";

class UrdfSecondReading : public ::testing::Test {
 protected:
  UrdfModel model() {
    std::vector<Error> errors;
    auto model = read_urdf(folder_.write("r.urdf", kUrdf), errors);
    EXPECT_TRUE(model) << (errors.empty() ? "" : errors.front().describe());
    return model.value_or(UrdfModel{});
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(UrdfSecondReading, AgreesWithTheFirst) {
  std::vector<Error> errors;
  check_second_reading(model(), kUrdf, errors);
  EXPECT_TRUE(errors.empty()) << errors.front().describe();
  for (const auto& robot : std::filesystem::directory_iterator(SIDESTEP_SOURCE_DIR "/robots")) {
    if (!robot.is_directory()) continue;
    const auto read = read_urdf(robot.path() / "robot.urdf", errors);
    EXPECT_TRUE(read) << errors.front().describe();
  }
}

/// A first reading that took anything for something else is found out.
TEST_F(UrdfSecondReading, FindsWhateverDiffers) {
  const UrdfModel read = model();
  ASSERT_EQ(read.links.size(), 1u);
  ASSERT_EQ(read.links[0].shapes.size(), 4u);
  using Change = std::function<void(std::vector<UrdfShape>&)>;
  const std::pair<int, Change> changes[] = {
      {1, [](auto& s) { std::get<Box>(s[0].shape).size_m.y() = 0.09; }},
      {1, [](auto& s) { s[0].T_link_shape.translation().y() = 0.2; }},
      {1,
       [](auto& s) {
         s[0].T_link_shape.rotate(Eigen::AngleAxisd(1e-6, Eigen::Vector3d::UnitZ()));
       }},
      {1, [](auto& s) { s[0].shape = Sphere{0.3}; }},
      {2, [](auto& s) { std::swap(s[1], s[2]); }},
      {1, [](auto& s) { std::get<Cylinder>(s[1].shape).radius_m = 0.5; }},
      {1, [](auto& s) { std::get<Cylinder>(s[1].shape).length_m = 0.1; }},
      {1, [](auto& s) { std::get<Sphere>(s[2].shape).radius_m = 0.24; }},
      {1, [](auto& s) { s[3].mesh_uri = "b.stl"; }},
      {1, [](auto& s) { s[3].mesh_scale.setOnes(); }},
      {1, [](auto& s) { s.push_back(s[3]); }},
  };
  for (std::size_t i = 0; i < std::size(changes); ++i) {
    UrdfModel changed = read;
    changes[i].second(changed.links[0].shapes);
    std::vector<Error> errors;
    check_second_reading(changed, kUrdf, errors);
    ASSERT_EQ(std::ssize(errors), changes[i].first) << i;
    EXPECT_THAT(errors[0].describe(), HasSubstr("two readings of collision shape "));
  }
  // The same of the text.
  for (const char* number : {"0.9", "-2e-1", "0.2 0.3", "0.5\"", "0.25", "scale=\"1 -1"}) {
    std::string text = kUrdf;
    const std::size_t at = text.find(number);
    ASSERT_NE(at, std::string::npos) << number;
    text.insert(text.find_first_of("0123456789", at), "7");
    std::vector<Error> errors;
    check_second_reading(read, text, errors);
    EXPECT_EQ(errors.size(), 1u) << number;
  }
}

}  // namespace
}  // namespace sidestep::urdf_robot
