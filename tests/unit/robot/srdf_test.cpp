#include "srdf_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.hpp"

namespace sidestep::urdf_robot {
namespace {

using ::testing::HasSubstr;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

class SrdfFile : public ::testing::Test {
 protected:
  Result<Srdf> read(const std::string& text) { return read_srdf(folder_.write("arm.srdf", text)); }
  /// What is wrong with a <robot> that holds this, in line 2.
  std::string mistake_in(const std::string& content) {
    return mistake_of("<robot name='arm'>\n" + content + "\n</robot>\n");
  }
  std::string mistake_of(const std::string& text) {
    const auto srdf = read(text);
    if (srdf) return "no error";
    EXPECT_EQ(srdf.error().code, ErrorCode::kConfig);
    return srdf.error().describe();
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(SrdfFile, IsReadWholeOrCountedAsPassedOver) {
  const auto srdf = read(R"(<?xml version="1.0"?>
<!-- of an arm -->
<robot name="arm">
  <virtual_joint name="world" type="fixed" parent_frame="world" child_link="base"/>
  <group name="whole"><chain base_link="base" tip_link="hand"/><joint name="world"/></group>
  <group name="both"><group name="whole"/><link name="hand"/></group>
  <group_state name="home" group="whole"><joint name="elbow" value="0.5"/></group_state>
  <end_effector name="gripper" parent_link="hand" group="both"/>
  <passive_joint name="a"/><passive_joint name="b"/>
  <drake:collision_filter_group name="g"><drake:member link="base"/></drake:collision_filter_group>
  <disable_collisions link1="base" link2="hand" reason="Never"/>
</robot>)");
  ASSERT_TRUE(srdf) << srdf.error().describe();
  ASSERT_EQ(srdf->groups.size(), 2u);
  EXPECT_EQ(srdf->groups[0].chains.size(), 1u);
  EXPECT_EQ(srdf->groups[0].joints, std::vector<std::string>{"world"});
  EXPECT_EQ(srdf->groups[1].groups, std::vector<std::string>{"whole"});
  EXPECT_EQ(srdf->poses.size(), 1u);
  EXPECT_EQ(srdf->disabled.size(), 1u);
  EXPECT_EQ(srdf->virtual_joints, std::set<std::string>{"world"});
  EXPECT_THAT(
      srdf->passed_over,
      UnorderedElementsAre(Pair("virtual_joint", 1), Pair("end_effector", 1),
                           Pair("passive_joint", 2), Pair("drake:collision_filter_group", 1)));
}

TEST_F(SrdfFile, NamesWhatItDoesNotUnderstandAndWhere) {
  const std::pair<std::string, std::string> cases[] = {
      {"<disable_collision link1='a' link2='b'/>",
       "arm.srdf:2:1: <disable_collision> is no element of <robot> (did you mean "
       "'disable_collisions'?)"},
      {"<disable_collisions link1='a' link2='b' resaon='x'/>",
       "arm.srdf:2:41: <disable_collisions> has no attribute 'resaon' (did you mean 'reason'?)"},
      {"<disable_collisions link1='a'/>", "<disable_collisions> has no attribute 'link2'"},
      {"<group name='g'><joints name='j'/></group>",
       "arm.srdf:2:17: <joints> is no element of <group> (did you mean 'joint'?)"},
      {"<group name='g'><chain base_link='a' tip_link='b' root='c'/></group>",
       "<chain> has no attribute 'root'"},
      {"<group name='g' links='a'/>", "<group> has no attribute 'links'"},
      {"<group name='g'>elbow</group>", "expected an element, found 'elbow'"},
      {"elbow", "expected an element, found 'elbow'"},
      {"<group name='g'/><group name='g'/>", "there is another group 'g'"},
      {"<group_state name='s' group='g'><joint name='j' value='0 1'/></group_state>",
       "'0 1' is not a number"},
      {"<group_state name='s'><joint name='j' value='1'/><joint name='j' value='2'/></group_state>",
       "joint 'j' stands in the pose twice"},
      {"<group_state name='s'><link name='j'/></group_state>",
       "<link> is no element of <group_state>"},
  };
  for (const auto& [content, told] : cases) EXPECT_THAT(mistake_in(content), HasSubstr(told));
  EXPECT_THAT(mistake_of("<robot name='a'/>\n<robot name='b'/>\n"),
              HasSubstr("arm.srdf:2:1: the file goes on behind the end of its <robot>"));
  EXPECT_THAT(mistake_of("<robot name='a'/>" + std::string(1, '\0') + "<robot name='b'/>"),
              HasSubstr("a byte of 0"));
}

}  // namespace
}  // namespace sidestep::urdf_robot
