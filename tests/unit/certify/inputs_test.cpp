#include <octomap/OcTree.h>
#include <ompl/base/ScopedState.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/base/spaces/SE2StateSpace.h>
#include <ompl/geometric/PathGeometric.h>

#include <cstring>
#include <fstream>

#include <gmock/gmock.h>

#include <sidestep/core/index.hpp>

#include "certify_testing.hpp"
#include "inputs.hpp"
#include "robot_testing.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

namespace ob = ompl::base;
namespace og = ompl::geometric;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Outcome = Certification::Outcome;

class Inputs : public ::testing::Test {
 protected:
  template <class Value>
  [[nodiscard]] static std::string mistake(const Result<Value>& read) {
    return read ? "" : read.error().describe();
  }
  [[nodiscard]] Result<std::vector<NamedMotion>> rows(const std::string& name,
                                                      const std::string& bytes,
                                                      const std::vector<std::string>& joints = {
                                                          "slide", "turn"}) const {
    return read_motions(folder_.write(name, bytes), crane_->description(), {{}, joints, {}});
  }
  /// Where the crane's joints are at the beginning and at the end.
  static void expect_ways(const Result<std::vector<NamedMotion>>& motions,
                          const std::array<double, 2>& first, const std::array<double, 2>& last) {
    ASSERT_TRUE(motions) << motions.error().describe();
    ASSERT_EQ(motions->size(), 1U);
    const PolynomialMotion& motion = motions->front().motion;
    EXPECT_FALSE(motion.has_times);
    for (std::size_t j = 0; j < 2; ++j) {
      const auto& c = motion.pieces.back().coefficients[j];
      EXPECT_NEAR(motion.pieces.front().coefficients[j][0], first[j], 1e-5);
      EXPECT_NEAR(c[0] + c[1], last[j], 1e-5);
    }
  }
  [[nodiscard]] Result<SceneInput> scene(const std::string& name, const std::string& text,
                                         std::optional<double> point_radius_m = {}) const {
    return read_certified_scene(folder_.write(name, text), crane_->description(), point_radius_m);
  }

  testing_support::TemporaryFolder folder_;
  std::shared_ptr<const KinematicTree> crane_ = testing_certify::crane(0.1);
};

/// As the format's description has it: magic, version, length of the header, header, numbers.
template <class Number>
std::string npy(const std::string& dictionary, const std::vector<Number>& numbers) {
  std::string header = dictionary;
  while ((10 + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size() % 256);
  bytes += static_cast<char>(header.size() / 256);
  bytes += header;
  bytes.append(reinterpret_cast<const char*>(numbers.data()), sizeof(Number) * numbers.size());
  return bytes;
}

TEST_F(Inputs, ArraysOfNumPyAreRowsOfPositions) {
  const std::vector<double> numbers{0.5, 0.0, 0.6, 1.0, 0.7, 2.0};
  expect_ways(
      rows("a.npy", npy("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }", numbers)),
      {0.0, 0.5}, {2.0, 0.7});
  const std::vector<float> singles(numbers.begin(), numbers.end());
  expect_ways(
      rows("b.npy", npy("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 3, 2), }", singles)),
      {0.0, 0.5}, {2.0, 0.7});
}

TEST_F(Inputs, ArraysThatAreNotRowsAreRefused) {
  const std::vector<double> numbers{0.5, 0.0, 0.6, 1.0};
  const auto of = [&](const std::string& dictionary) {
    return mistake(rows("c.npy", npy(dictionary, numbers)));
  };
  EXPECT_THAT(of("{'descr': '<f8', 'fortran_order': True, 'shape': (2, 2), }"),
              HasSubstr("row by row"));
  EXPECT_THAT(of("{'descr': '<i8', 'fortran_order': False, 'shape': (2, 2), }"),
              HasSubstr("floats of 4 or 8 bytes are wanted"));
  EXPECT_THAT(of("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }"),
              HasSubstr("has 32 bytes where its header says 3 rows of 2"));
  EXPECT_THAT(of("{'descr': '<f8', 'fortran_order': False, 'shape': (4,), }"),
              HasSubstr("two dimensions"));
  EXPECT_THAT(of("{'descr': '<f8', 'fortran_order': False, 'shape': (0, 2305843009213693952), }"),
              HasSubstr("has 32 bytes where its header says 0 rows of 2305843009213693952"));
  EXPECT_THAT(mistake(rows("d.npy", "nothing of the kind")), HasSubstr("is no array of NumPy"));
  const std::string whole = npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2), }",
                                std::vector<double>{0.5, 0.0, std::nan(""), 1.0});
  EXPECT_THAT(mistake(rows("e.npy", whole)), HasSubstr("row 2, column 1 is not a finite number"));
  for (std::size_t length = 0; length < whole.size(); length += 3) {
    EXPECT_FALSE(rows("f.npy", whole.substr(0, length))) << length;
  }
}

TEST_F(Inputs, PathsAreReadAsOmplPrintsThem) {
  const auto space = std::make_shared<ob::RealVectorStateSpace>(2);
  space->setBounds(-10.0, 10.0);
  space->setup();
  og::PathGeometric path(std::make_shared<ob::SpaceInformation>(space));
  for (const auto& [slide, turn] : {std::pair(0.5, -1.0), {0.6, 0.25}, {0.75, 1.5}}) {
    ob::ScopedState<ob::RealVectorStateSpace> state(space);
    state[0] = slide;
    state[1] = turn;
    path.append(state.get());
  }
  std::ostringstream matrix, printed;
  path.printAsMatrix(matrix);
  path.print(printed);
  expect_ways(rows("matrix.txt", matrix.str()), {-1.0, 0.5}, {1.5, 0.75});
  expect_ways(rows("printed.txt", printed.str()), {-1.0, 0.5}, {1.5, 0.75});
  EXPECT_THAT(mistake(rows("matrix.txt", matrix.str(), {})), HasSubstr("--joints turn,slide"));
  EXPECT_THAT(mistake(rows("matrix.txt", matrix.str(), {"turn", "lift"})),
              HasSubstr("moves no joint 'lift'"));
  EXPECT_THAT(mistake(rows("matrix.txt", matrix.str(), {"turn"})),
              HasSubstr("joint 'slide' is not in the motion"));
  EXPECT_THAT(mistake(rows("matrix.txt", "1 2\n3 four\n")), HasSubstr("matrix.txt:2: '3 four'"));
  EXPECT_THAT(mistake(rows("matrix.txt", "1 2\n3\n")),
              HasSubstr("matrix.txt:2: 1 numbers where the first state has 2"));
  EXPECT_THAT(mistake(rows("matrix.txt", "]\n")), HasSubstr("matrix.txt:1: ']' is no state"));
  const std::string long_line = "RealVectorState [" + std::string(1'000'000, ' ') + "1]\n";
  EXPECT_THAT(mistake(rows("printed.txt", long_line + long_line)), HasSubstr("1 columns where"));
}

TEST_F(Inputs, CompoundStatesOfOmplAreOneRowEach) {
  const auto space = std::make_shared<ob::SE2StateSpace>();
  ob::RealVectorBounds bounds(2);
  bounds.setLow(-10.0);
  bounds.setHigh(10.0);
  space->setBounds(bounds);
  og::PathGeometric path(std::make_shared<ob::SpaceInformation>(space));
  for (const double x : {1.0, 2.0}) {
    ob::ScopedState<ob::SE2StateSpace> state(space);
    state->setXY(x, -x);
    state->setYaw(0.1 * x);
    path.append(state.get());
  }
  std::ostringstream printed;
  path.print(printed);
  RobotDescription base;
  base.name = "base";
  for (const char* joint : {"x", "y", "yaw"}) base.joints.push_back({joint});
  const auto motions =
      read_motions(folder_.write("path.txt", printed.str()), base, {{}, {"x", "y", "yaw"}, {}});
  ASSERT_TRUE(motions) << motions.error().describe();
  const auto& piece = motions->front().motion.pieces.at(0);
  EXPECT_NEAR(piece.coefficients[1][0], -1.0, 1e-9);
  EXPECT_NEAR(piece.coefficients[2][0] + piece.coefficients[2][1], 0.2, 1e-9);
}

TEST_F(Inputs, DatabasesOfBenchmarksHoldNoPaths) {
  EXPECT_THAT(mistake(rows("benchmark.db", "SQLite")), HasSubstr("holds no paths"));
}

TEST_F(Inputs, OctoMapsAreTheirOccupiedLeaves) {
  octomap::OcTree tree(0.05);
  for (int x = 0; x < 8; ++x) {
    for (int y = 0; y < 8; ++y) {
      tree.updateNode(octomap::point3d(0.025F + 0.05F * static_cast<float>(x),
                                       0.025F + 0.05F * static_cast<float>(y), 0.525F),
                      true);
    }
  }
  tree.updateNode(octomap::point3d(1.0F, 1.0F, 1.0F), false);
  tree.prune();
  for (const char* name : {"map.bt", "map.ot"}) {
    const std::filesystem::path file = folder_.path() / name;
    ASSERT_TRUE(file.extension() == ".bt" ? tree.writeBinary(file.string())
                                          : tree.write(file.string()));
    const auto read = read_certified_scene(file, crane_->description(), {});
    ASSERT_TRUE(read) << read.error().describe();
    double volume_m3 = 0.0;
    for (const Swarm::Member& cube : read->apart_from.swarms.at(0).members) {
      volume_m3 += std::pow(cube.size_m, 3);
      EXPECT_GT(cube.centre_m.z(), 0.49);
      EXPECT_LT(cube.centre_m.z(), 0.56);
    }
    EXPECT_NEAR(volume_m3, 64 * std::pow(0.05, 3), 1e-9);
    EXPECT_THAT(mistake(scene(name, "nothing of the kind")), HasSubstr("is no OctoMap"));
  }
}

TEST_F(Inputs, CloudsAreBallsOfAGivenRadius) {
  const std::string cloud =
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ascii\n1 2 3\n0.5 0 0\n";
  const auto read = scene("cloud.pcd", cloud, 0.02);
  ASSERT_TRUE(read) << read.error().describe();
  const Swarm& swarm = read->apart_from.swarms.at(0);
  EXPECT_EQ(swarm.kind, Swarm::Kind::kBalls);
  ASSERT_EQ(swarm.members.size(), 2U);
  EXPECT_EQ(swarm.members[1].centre_m.x(), 0.5);
  EXPECT_EQ(swarm.members[1].size_m, 0.02);
  EXPECT_THAT(mistake(scene("cloud.pcd", cloud)), HasSubstr("--point_radius_m"));
}

constexpr const char* kCarrying = R"(robot_state:
  attached_collision_objects:
    - link_name: tip
      touch_links: [arm]
      object:
        header: {frame_id: tip}
        id: rod
        primitives: [{type: 1, dimensions: [0.02, 0.02, 1.0]}]
        primitive_poses: [{position: {x: 0, y: 0, z: 0.5}, orientation: {x: 0, y: 0, z: 0, w: 1}}]
world:
  collision_objects:
    - header: {frame_id: base}
      id: lamp
      primitives: [{type: 2, dimensions: [0.1]}]
      primitive_poses: [{position: {x: 0.6, y: 0, z: 0.9}, orientation: {x: 0, y: 0, z: 0, w: 1}}]
)";

TEST_F(Inputs, WhatARobotCarriesMovesWithItsLink) {
  const auto read = scene("scene.yaml", kCarrying);
  ASSERT_TRUE(read) << read.error().describe();
  ASSERT_EQ(read->attached.size(), 1U);
  const PolynomialMotion motion = testing_certify::straight({{-0.5, 0.6}, {0.5, 0.6}});
  const auto without = certify(*crane_, read->apart_from, motion, {});
  ASSERT_TRUE(without) << without.error().describe();
  EXPECT_EQ(without->outcome, Outcome::kProven);
  const auto robot = carrying(*crane_, read->attached, "scene.yaml");
  ASSERT_TRUE(robot) << robot.error().describe();
  const auto with = certify(**robot, read->apart_from, motion, {});
  ASSERT_TRUE(with && with->witness);
  EXPECT_EQ(with->witness->a, "rod");
  EXPECT_EQ(with->witness->b, "lamp");
  // It is held against links that it does not turn against, too: those that it may not touch.
  std::string text = kCarrying;
  text.replace(text.find("link_name: tip"), 14, "link_name: arm");
  text.replace(text.find("touch_links: [arm]"), 18, "touch_links: []");
  text.replace(text.find("frame_id: tip"), 13, "frame_id: arm");
  const auto beside = scene("scene.yaml", text);
  ASSERT_TRUE(beside) << beside.error().describe();
  const auto touching = carrying(*crane_, beside->attached, "scene.yaml");
  EXPECT_THAT((*touching)->description().self_collision_pairs, ElementsAre(std::pair(2, 3)));
  text = kCarrying;
  text.replace(text.find("touch_links: [arm]"), 18, "touch_links: [leg]");
  const auto wrong = scene("scene.yaml", text);
  EXPECT_THAT(mistake(carrying(*crane_, wrong->attached, "scene.yaml")),
              HasSubstr("'leg', which is no link"));
  text = kCarrying;
  text.replace(text.find("frame_id: tip"), 13, "frame_id: arm");
  EXPECT_THAT(mistake(scene("scene.yaml", text)),
              AllOf(HasSubstr("scene.yaml:6:28"),
                    HasSubstr("object 'rod' is attached to 'tip' and in the frame 'arm'")));
}

constexpr const char* kUrdf = R"(<robot name="folding">
  <link name="root"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  <joint name="first" type="revolute"><parent link="root"/><child link="upper"/>
    <origin xyz="0 0 0.2"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <link name="upper"><collision><origin xyz="0 0 0.3"/><geometry><box size="0.1 0.1 0.5"/></geometry></collision></link>
  <joint name="second" type="revolute"><parent link="upper"/><child link="fore"/>
    <origin xyz="0 0 0.65"/><axis xyz="0 1 0"/><limit lower="-3.2" upper="3.2" velocity="1" effort="1"/></joint>
  <link name="fore"><collision><origin xyz="0 0 0.5"/><geometry><box size="0.1 0.1 0.9"/></geometry></collision></link>
</robot>
)";

/// A forearm that folds back through the upper arm down into the root.
TEST_F(Inputs, LinksOfAUrdfAreHeldAgainstEachOtherButThoseThatItsSrdfDisables) {
  testing_robot::Loader loader;
  const std::string urdf = folder_.write("folding.urdf", kUrdf).string();
  const auto outcome = [&](const RobotInput& input) -> std::pair<Outcome, std::string> {
    const auto robot = read_certified_robot(input, loader.context);
    if (!robot) throw std::runtime_error(robot.error().describe());
    const auto found =
        certify(**robot, {}, testing_certify::straight({{0.0, 0.0}, {0.0, 3.1}}, 10.0), {});
    if (!found) throw std::runtime_error(found.error().describe());
    return {found->outcome, found->witness ? found->witness->a + "/" + found->witness->b : ""};
  };
  const auto srdf = [&](const std::string& pairs) {
    return folder_.write("folding.srdf", "<robot name=\"folding\">" + pairs + "</robot>");
  };
  const std::string adjacent = "<disable_collisions link1=\"upper\" link2=\"fore\"/>";
  const std::string other = "<disable_collisions link1=\"fore\" link2=\"root\"/>";
  const std::string lower = "<disable_collisions link1=\"root\" link2=\"upper\"/>";
  EXPECT_EQ(outcome({urdf, {}, {}, {}}).second, "root/fore");
  EXPECT_EQ(outcome({urdf, srdf(lower), {}, {}}).first, Outcome::kRefuted);
  EXPECT_EQ(outcome({urdf, srdf(adjacent + lower), {}, {}}).second, "root/fore");
  EXPECT_EQ(outcome({urdf, srdf(adjacent + other), {}, {}}).first, Outcome::kProven);
  // Links that no joint moves against each other are held, too, as they are in MoveIt.
  std::string rigid = kUrdf;
  rigid.replace(rigid.find("\"second\" type=\"revolute\""), 24, "\"second\" type=\"fixed\"");
  const auto stiff = read_certified_robot(
      {folder_.write("stiff.urdf", rigid).string(), srdf(lower + other), {}, {}}, loader.context);
  ASSERT_TRUE(stiff) << stiff.error().describe();
  EXPECT_EQ((*stiff)->description().self_collision_pairs.size(), 1U);
  EXPECT_THAT(mistake(read_certified_robot({urdf, urdf, {}, {}}, loader.context)),
              HasSubstr("expected an SRDF"));
  const auto half =
      folder_.write("half.srdf", "<robot>\n<disable_collisions link1=\"a\"/></robot>");
  EXPECT_THAT(mistake(read_certified_robot({urdf, half, {}, {}}, loader.context)),
              HasSubstr("half.srdf:2"));
}

/// Nothing that moves is left out of what a robot is held against.
TEST_F(Inputs, ScenesStandStill) {
  EXPECT_THAT(mistake(scene("s.yaml",
                            "objects: []\npeople: {groups: [{name: g, policy: waypoints, route_m: "
                            "[[0.5, -0.1], [0.5, 0.1]]}]}\n")),
              HasSubstr("s.yaml: people and objects that move"));
  EXPECT_THAT(mistake(scene("s.yaml",
                            "objects:\n  - {name: a, shape: {sphere: {radius_m: 0.1}}, waypoints: "
                            "[{time_s: 0, xyz_m: [1, 0, 0]}, {time_s: 1, xyz_m: [2, 0, 0]}]}\n")),
              HasSubstr("s.yaml: people and objects that move"));
  EXPECT_THAT(mistake(scene("s.txt", "objects: []")), HasSubstr("a scene is .yaml"));
}

TEST_F(Inputs, JointsStayWhereTheCommandSays) {
  testing_robot::Loader loader;
  const std::string urdf = folder_.write("folding.urdf", kUrdf).string();
  const auto robot = read_certified_robot({urdf, {}, {"second=0.5"}, {}}, loader.context);
  ASSERT_TRUE(robot) << robot.error().describe();
  EXPECT_EQ((*robot)->description().dof(), 1);
  // Of a profile also what it plans for: all links are where they are with the joint.
  const auto whole = read_certified_robot({"panda", {}, {}, {}}, loader.context);
  const auto held = read_certified_robot(
      {"panda", {}, {"panda_joint4=-1.7", "panda_finger_joint1=0.01"}, {}}, loader.context);
  const auto closed =
      read_certified_robot({"panda", {}, {"panda_finger_joint1=0.01"}, {}}, loader.context);
  ASSERT_TRUE(whole && held && closed) << mistake(held);
  EXPECT_EQ((*held)->description().dof(), (*whole)->description().dof() - 1);
  Scratch scratch;
  std::vector<Transform> links((*held)->description().links.size()), same = links;
  (*held)->link_poses(std::vector{0.1, 0.2, 0.3, 0.5, 0.6, 0.7}, links, scratch);
  (*closed)->link_poses(std::vector{0.1, 0.2, 0.3, -1.7, 0.5, 0.6, 0.7}, same, scratch);
  for (std::size_t i = 0; i < links.size(); ++i) EXPECT_TRUE(links[i].isApprox(same[i], 1e-12));
  EXPECT_THAT(mistake(read_certified_robot({"panda", {}, {"panda_joint4=x"}, {}}, loader.context)),
              HasSubstr("--fixed panda_joint4=x"));
  EXPECT_THAT(mistake(read_certified_robot({"panda", {}, {"panda_joint4=9"}, {}}, loader.context)),
              HasSubstr("panda_joint4 would stay outside of its limits"));
  EXPECT_THAT(mistake(read_certified_robot({urdf, {}, {"second"}, {}}, loader.context)),
              HasSubstr("'second' is not JOINT=VALUE"));
  EXPECT_THAT(mistake(read_certified_robot({urdf, {}, {"third=1"}, {}}, loader.context)),
              HasSubstr("third"));
}

}  // namespace
}  // namespace sidestep
