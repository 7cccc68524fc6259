#include <cmath>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Json = nlohmann::json;

/// An arm on a box that a wheel, of which no speed is known, carries; a slide that nobody has
/// bounded; a mesh in COLLADA at its end. The elbow folds far enough for the hand to reach the box.
constexpr const char* kUrdf = R"(<robot name="arm">
<link name="base"><collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision></link>
<link name="upper"><collision><origin xyz="0 0 0.2"/><geometry>
  <cylinder radius="0.05" length="0.3"/></geometry></collision></link>
<link name="hand"><collision><geometry>
  <mesh filename="package://arm_meshes/hand.dae"/></geometry></collision></link>
<link name="wheel"/><link name="slide"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
  <origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="2" velocity="1" effort="1"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="hand"/>
  <origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
<joint name="roll" type="continuous"><parent link="base"/><child link="wheel"/></joint>
<joint name="free" type="prismatic"><parent link="base"/><child link="slide"/>
  <limit lower="0.1" upper="0.3" velocity="0" effort="1"/></joint>
</robot>
)";

/// A box of 10 x 10 x 20 cm, in centimetres, its foot in the link's origin.
constexpr const char* kHand = R"(<COLLADA><asset><unit meter="0.01"/></asset>
<library_geometries><geometry id="box"><mesh>
<source id="p"><float_array id="f" count="24">-5 -5 0 5 -5 0 5 5 0 -5 5 0
-5 -5 20 5 -5 20 5 5 20 -5 5 20</float_array>
<technique_common><accessor source="#f" count="8" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="6"><input semantic="VERTEX" source="#v" offset="0"/>
<vcount>4 4 4 4 4 4</vcount>
<p>0 3 2 1 4 5 6 7 0 1 5 4 1 2 6 5 2 3 7 6 3 0 4 7</p></polylist>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#box"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>
)";

class NewRobotTest : public ::testing::Test {
 protected:
  void SetUp() override {
    urdf_ = folder_.write("robot/arm.urdf", kUrdf).string();
    folder_.write("robot/arm_meshes/hand.dae", kHand);
    out_ = (folder_.path() / "robots" / "arm").string();
  }
  [[nodiscard]] Finished make(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{"robot", "new", urdf_, "--out", out_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  [[nodiscard]] std::string profile() const {
    std::ifstream in(out_ + "/profile.yaml");
    return {std::istreambuf_iterator<char>(in), {}};
  }

  testing_support::TemporaryFolder folder_;
  std::string urdf_;
  std::string out_;
};

TEST_F(NewRobotTest, CoversAnArmAndHoldsWhatCanTouch) {
  const Finished made = make({"--protrusion_m", "0.03"});
  ASSERT_EQ(made.exit_code, 0) << made.error;
  EXPECT_THAT(made.out, HasSubstr("not planned: roll: no limit of velocity"));
  EXPECT_THAT(made.out, HasSubstr("not planned: free: no limit of velocity"));
  EXPECT_THAT(profile(), HasSubstr("  pairs:\n    - [base, hand]\n\n"));
  EXPECT_THAT(profile(), HasSubstr("  free: 0.1  # "));

  const Finished shown = run({"robot", out_, "--json"});
  ASSERT_EQ(shown.exit_code, 0) << shown.error;
  const Json robot = Json::parse(shown.out);
  EXPECT_EQ(robot.at("robot"), "arm");
  EXPECT_THAT(robot.at("joints"), ElementsAre("shoulder", "elbow"));
  EXPECT_EQ(robot.at("whole").at("surface_share"), 1.0);
  EXPECT_LE(robot.at("whole").at("protrusion_m").get<double>(), 0.03 + 1e-9);
  EXPECT_NEAR(robot.at("whole").at("shapes_m3").get<double>(),
              0.4 * 0.4 * 0.2 + M_PI * 0.05 * 0.05 * 0.3 + 0.1 * 0.1 * 0.2, 2e-4);

  // What is there stays.
  const Finished again = make();
  EXPECT_EQ(again.exit_code, 4);
  EXPECT_THAT(again.error, HasSubstr("there is a profile already"));
}

TEST_F(NewRobotTest, TakesGroupPosesAndPairsOfAnSrdf) {
  const auto srdf = folder_.write("arm.srdf", R"(<robot name="arm">
<group name="lower"><chain base_link="base" tip_link="upper"/></group>
<group_state name="bent" group="lower"><joint name="shoulder" value="0.5"/></group_state>
<group_state name="beyond" group="lower"><joint name="shoulder" value="5"/></group_state>
<disable_collisions link1="upper" link2="hand"/>
</robot>)");
  const Finished made = make({"--srdf", srdf.string(), "--group", "lower"});
  ASSERT_EQ(made.exit_code, 0) << made.error;
  EXPECT_THAT(made.out, HasSubstr("not planned: elbow: not of the group"));
  EXPECT_THAT(made.out, HasSubstr("note: pose 'beyond' of the SRDF is left out: shoulder"));
  EXPECT_THAT(profile(), HasSubstr("joints:\n  - shoulder\n"));
  EXPECT_THAT(profile(), HasSubstr("poses:\n  bent:\n    shoulder: 0.5\n\n"));
  EXPECT_THAT(profile(), HasSubstr("  pairs:\n    - [base, upper]\n    - [base, hand]\n\n"));
  EXPECT_EQ(run({"robot", out_}).exit_code, 0);
}

TEST_F(NewRobotTest, KeepsTheGroupsOfAnSrdf) {
  const auto srdf = folder_.write("arm.srdf", R"(<robot name="arm">
<group name="lower"><chain base_link="base" tip_link="upper"/></group>
<group name="whole"><chain base_link="base" tip_link="hand"/></group>
<group name="odd"><chain base_link="base" tip_link="uper"/></group>
</robot>)");
  const Finished made = make({"--srdf", srdf.string()});
  ASSERT_EQ(made.exit_code, 0) << made.error;
  EXPECT_THAT(profile(), HasSubstr("groups:\n  lower:\n    - shoulder\n\nfixed_joints:"));
  EXPECT_THAT(made.out, HasSubstr("note: group 'odd' of the SRDF is left out: "));
}

/// With a base as high as the shoulder, in which the upper arm stands.
TEST_F(NewRobotTest, LeavesOutAPairThatNoPoseParts) {
  std::string urdf = kUrdf;
  urdf.replace(urdf.find("0.4 0.4 0.2"), 11, "0.4 0.4 0.9");
  folder_.write("robot/arm.urdf", urdf);
  const auto srdf = folder_.write("arm.srdf", R"(<robot name="arm">
<disable_collisions link1="upper" link2="hand"/>
</robot>)");
  const Finished made = make({"--srdf", srdf.string()});
  ASSERT_EQ(made.exit_code, 0) << made.error;
  EXPECT_THAT(made.out, HasSubstr("note: base and upper touch wherever the joints are"));
  EXPECT_THAT(profile(), HasSubstr("  pairs:\n    - [base, hand]\n\n"));
}

TEST_F(NewRobotTest, FindsAPackageUnderAnotherName) {
  std::filesystem::rename(folder_.path() / "robot/arm_meshes", folder_.path() / "elsewhere");
  EXPECT_EQ(make().exit_code, 2);
  const Finished made =
      make({"--package-path", "arm_meshes=" + (folder_.path() / "elsewhere").string()});
  ASSERT_EQ(made.exit_code, 0) << made.error;
  EXPECT_THAT(profile(), HasSubstr("package_paths:\n  - {arm_meshes: \"../../elsewhere\"}\n"));
  EXPECT_EQ(run({"robot", out_}).exit_code, 0);
}

TEST_F(NewRobotTest, SaysWhatIsWrongAndLeavesNothing) {
  const auto refused = [&](const std::vector<std::string>& more) {
    const Finished made = make(more);
    EXPECT_EQ(made.exit_code, 2) << made.out;
    EXPECT_FALSE(std::filesystem::exists(out_));
    return made.error;
  };
  const auto srdf = folder_.write("arm.srdf", R"(<robot name="arm">
<group name="lower"><chain base_link="base" tip_link="uper"/></group>
<disable_collisions link1="upper" link2="hnd"/>
</robot>)");
  EXPECT_THAT(refused({"--srdf", srdf.string()}),
              HasSubstr("arm.srdf:3:1: the URDF has no link 'hnd'"));
  EXPECT_THAT(refused({"--srdf", srdf.string(), "--group", "lower"}), HasSubstr("no link 'uper'"));
  EXPECT_THAT(refused({"--srdf", srdf.string(), "--group", "loewr"}), HasSubstr("lower"));
  EXPECT_THAT(refused({"--group", "lower"}), HasSubstr("--srdf"));
  folder_.write("robot/arm_meshes/hand.dae", "<COLLADA/>");
  EXPECT_THAT(refused({}), HasSubstr("hand.dae:1: link 'hand': there is no <scene>"));
  std::filesystem::remove(folder_.path() / "robot/arm_meshes/hand.dae");
  EXPECT_THAT(refused({}), HasSubstr("package://arm_meshes/hand.dae"));
}

TEST_F(NewRobotTest, AUrdfIsShownAsItIs) {
  const Finished shown = run({"robot", urdf_});
  EXPECT_EQ(shown.exit_code, 2) << "free has no velocity, and it is not known which to plan";
  EXPECT_THAT(shown.error, HasSubstr("'free' has no velocity limit above zero"));
  std::string text = kUrdf;
  for (const char* const joint : {"velocity=\"0\"", "type=\"continuous\""}) {
    text.replace(text.find(joint), std::string(joint).size(),
                 joint[0] == 'v' ? "velocity=\"1\"" : "type=\"fixed\"");
  }
  folder_.write("robot/arm.urdf", text);
  const Finished whole = run({"robot", urdf_});
  EXPECT_EQ(whole.exit_code, 0) << whole.error;
  EXPECT_THAT(whole.out, HasSubstr("arm: 3 planned joints"));
  EXPECT_THAT(run({"robot", urdf_, "--fit"}).error, HasSubstr("robot new"));
  EXPECT_THAT(run({"robot"}).error, HasSubstr("PROFILE is required"));
}

}  // namespace
}  // namespace sidestep::testing
