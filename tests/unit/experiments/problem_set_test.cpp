#include <sidestep/problems/problem_set.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

RobotDescription shoulder_and_elbow() {
  RobotDescription robot;
  robot.name = "arm";
  robot.joints.resize(2);
  robot.joints[0].name = "shoulder";
  robot.joints[1].name = "elbow";
  return robot;
}

Json family(const std::string& name) {
  const Json still = {{"position", {0.5, 0.0, 0.2}},
                      {"quaternion_xyzw", {0.0, 0.0, 0.7071, 0.7071}}};
  Json box = still, can = still, ball = still;
  box.update({{"name", "shelf"}, {"type", "box"}, {"size", {0.2, 0.4, 0.6}}});
  can.update({{"name", "can"}, {"type", "cylinder"}, {"radius", 0.05}, {"height", 0.3}});
  ball.update({{"name", "ball"}, {"type", "sphere"}, {"radius", 0.1}});
  return {{"format", "mbm-neutral/1"},
          {"family", name},
          {"joint_names", {"elbow", "wrist", "shoulder"}},
          {"problems",
           {{{"index", 4},
             {"start", {0.1, 9.0, 0.3}},
             {"goals", {{-0.1, 9.0, -0.3}}},
             {"obstacles", {box, can, ball}}}}}};
}

class ProblemSetTest : public ::testing::Test {
 protected:
  std::string mistake(const Json& content) {
    const auto read =
        read_problem_set(folder_.write("set.json", content.dump()), shoulder_and_elbow());
    return read ? "" : read.error().describe();
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(ProblemSetTest, ReadsConfigurationsByTheNamesOfJoints) {
  const auto read =
      read_problem_set(folder_.write("set.json", family("shelf").dump()), shoulder_and_elbow());
  ASSERT_TRUE(read) << read.error().describe();
  ASSERT_EQ(read->size(), 1u);
  EXPECT_EQ(read->front().family, "shelf");
  EXPECT_EQ(read->front().index, 4);
  EXPECT_EQ(read->front().q_start, Eigen::Vector2d(0.3, 0.1));
  EXPECT_EQ(read->front().q_goal, Eigen::Vector2d(-0.3, -0.1));
}

TEST_F(ProblemSetTest, PutsShapesWhereTheyStand) {
  const auto read =
      read_problem_set(folder_.write("set.json", family("shelf").dump()), shoulder_and_elbow());
  ASSERT_TRUE(read) << read.error().describe();
  const Scene& scene = *read->front().scene;
  ASSERT_EQ(scene.objects().size(), 3u);
  EXPECT_EQ(scene.objects()[1].name, "can");
  // A quarter turn about z: the box's 0.4 m lie along the world's x, and it is the nearest there.
  EXPECT_NEAR(scene.signed_distance({0.5 + 0.2 + 0.3, 0.0, 0.2}, 0.0).distance_m, 0.3, 1e-4);
  EXPECT_NEAR(scene.signed_distance({0.5, 0.1 + 0.3, 0.2}, 0.0).distance_m, 0.3, 1e-4);
}

TEST_F(ProblemSetTest, ReadsAFolderInOrderOfNames) {
  folder_.write("sets/b.json", family("second").dump());
  folder_.write("sets/a.json", family("first").dump());
  folder_.write("sets/README.md", "not a set");
  const auto read = read_problem_set(folder_.path() / "sets", shoulder_and_elbow());
  ASSERT_TRUE(read) << read.error().describe();
  ASSERT_EQ(read->size(), 2u);
  EXPECT_EQ((*read)[0].family, "first");
  EXPECT_EQ((*read)[1].family, "second");
}

TEST_F(ProblemSetTest, RefusesWhatItWouldHaveToLeaveOut) {
  const auto with = [](const char* pointer, const Json& value) {
    Json content = family("shelf");
    content[Json::json_pointer(pointer)] = value;
    return content;
  };
  EXPECT_EQ(mistake(with("/problems/0/other_joints", {{"finger", 0.1}})), "");
  EXPECT_EQ(mistake(with("/units", {{"length", "m"}, {"angle", "rad"}})), "");
  EXPECT_THAT(mistake(with("/units", {{"length", "mm"}})),
              HasSubstr("set.json: units.length: only 'm' is supported"));
  EXPECT_THAT(mistake(with("/obstacles", Json::array())),
              HasSubstr("set.json: unknown key `obstacles`"));
  EXPECT_THAT(mistake(with("/problems/0/obstacels", Json::array())),
              HasSubstr("problems[0]: unknown key `obstacels`: did you mean 'obstacles'?"));
  EXPECT_THAT(mistake(with("/problems/0/obstacles/2/size", {1.0, 1.0, 1.0})),
              HasSubstr("problems[0].obstacles[2]: unknown key `size`"));
  EXPECT_THAT(mistake(with("/joint_names", {"elbow", "elbow", "shoulder"})),
              HasSubstr("joint_names[1]: joint 'elbow' stands here twice"));
  // Of a key that an object has twice a parser keeps the last.
  std::string text = family("shelf").dump();
  text.insert(text.find("\"obstacles\""), "\"obstacles\":[],");
  const auto twice = read_problem_set(folder_.write("set.json", text), shoulder_and_elbow());
  ASSERT_FALSE(twice);
  EXPECT_THAT(twice.error().describe(),
              HasSubstr("set.json: an object has the key 'obstacles' twice"));
}

TEST_F(ProblemSetTest, NamesFileAndEntryOfAMistake) {
  Json content = family("shelf");
  content["problems"][0]["obstacles"][0]["size"][1] = 0.0;
  EXPECT_THAT(mistake(content), HasSubstr("set.json: problems[0].obstacles[0].size"));
  content = family("shelf");
  content["problems"][0]["obstacles"][1]["type"] = "cone";
  EXPECT_THAT(mistake(content), HasSubstr("found 'cone'"));
  content = family("shelf");
  content["problems"][0]["start"] = {0.1, 0.2};
  EXPECT_THAT(mistake(content), HasSubstr("problems[0].start"));
  content = family("shelf");
  content["joint_names"] = {"elbow", "wrist", "hand"};
  EXPECT_THAT(mistake(content), HasSubstr("'shoulder'"));
  content = family("shelf");
  content["format"] = "other/2";
  EXPECT_THAT(mistake(content), HasSubstr("mbm-neutral/1"));
  EXPECT_THAT(
      read_problem_set(folder_.path() / "none.json", shoulder_and_elbow()).error().describe(),
      HasSubstr("none.json"));
  std::filesystem::create_directory(folder_.path() / "empty");
  EXPECT_THAT(read_problem_set(folder_.path() / "empty", shoulder_and_elbow()).error().describe(),
              HasSubstr("no problems"));
}

}  // namespace
}  // namespace sidestep
