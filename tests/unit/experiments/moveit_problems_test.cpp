#include <sidestep/problems/problem_set.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;

RobotDescription reacher() {
  RobotDescription robot;
  robot.name = "reacher";
  robot.joints.resize(2);
  robot.joints[0].name = "shoulder";
  robot.joints[1].name = "elbow";
  robot.links = {{"pedestal", -1}, {"arm", 0}};
  return robot;
}

constexpr const char* kRequest = R"(
start_state:
  joint_state:
    header: {frame_id: pedestal}
    name: [elbow, finger, shoulder]
    position: [0.1, 0.04, 0.3]
group_name: arm
goal_constraints:
  - joint_constraints:
      - {joint_name: shoulder, position: -0.3, tolerance_above: 0.01}
      - {joint_name: elbow, position: -0.1}
)";

/// A crate whose own pose is a quarter turn about z at (0.5, 0, 0.2), with a post beside it.
constexpr const char* kScene = R"(
name: ""
robot_state:
  joint_state: {name: [shoulder, elbow], position: [9, 9]}
world:
  collision_objects:
    - id: crate
      header: {frame_id: pedestal}
      pose: {position: [0.5, 0, 0.2], orientation: [0, 0, 0.7071067811865476, 0.7071067811865476]}
      primitives:
        - {type: box, dimensions: [0.2, 0.4, 0.6]}
        - {type: 3, dimensions: [0.3, 0.05]}
      primitive_poses:
        - {position: [0, 0, 0], orientation: [0, 0, 0, 1]}
        - {position: {x: 1, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0, w: 1}}
    - id: ball
      header: {frame_id: world}
      primitives: [{type: SPHERE, dimensions: [0.1]}]
      primitive_poses: [{position: [-1, 0, 0], orientation: [0, 0, 0, 1]}]
)";

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return at == std::string::npos ? text : text.replace(at, what.size(), by);
}

class MoveItProblemsTest : public ::testing::Test {
 protected:
  Result<std::vector<SetProblem>> read(const std::string& scene, const std::string& request) {
    (void)folder_.write("cubby_reacher/scene0007.yaml", scene);
    (void)folder_.write("cubby_reacher/request0007.yaml", request);
    return read_moveit_family(folder_.path() / "cubby_reacher", reacher());
  }
  std::string mistake(const std::string& scene, const std::string& request) {
    const auto problems = read(scene, request);
    return problems ? "" : problems.error().describe();
  }
  double distance_at(const SetProblem& problem, const Eigen::Vector3d& p) {
    return problem.scene->signed_distance(p, 0.0).distance_m;
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(MoveItProblemsTest, TakesStartAndGoalByTheNamesOfJoints) {
  const auto problems = read(kScene, kRequest);
  ASSERT_TRUE(problems) << problems.error().describe();
  ASSERT_EQ(problems->size(), 1u);
  EXPECT_EQ(problems->front().family, "cubby");
  EXPECT_EQ(problems->front().index, 7);
  EXPECT_EQ(problems->front().q_start, Eigen::Vector2d(0.3, 0.1));
  EXPECT_EQ(problems->front().q_goal, Eigen::Vector2d(-0.3, -0.1));
}

TEST_F(MoveItProblemsTest, AShapeStandsAtTheObjectsPoseTimesItsOwn) {
  const auto problems = read(kScene, kRequest);
  ASSERT_TRUE(problems) << problems.error().describe();
  const SetProblem& problem = problems->front();
  ASSERT_EQ(problem.scene->objects().size(), 3u);
  EXPECT_EQ(problem.scene->objects()[0].name, "crate/0");
  EXPECT_EQ(problem.scene->objects()[2].name, "ball");
  // Turned, the box's 0.4 m lie along x; what is at x = 1 in the object is at y = 1 outside.
  EXPECT_NEAR(distance_at(problem, {0.5 + 0.2 + 0.15, 0.0, 0.2}), 0.15, 1e-12);
  EXPECT_NEAR(distance_at(problem, {0.5, 1.0, 0.2 + 0.15 + 0.05}), 0.05, 1e-12);
  EXPECT_NEAR(distance_at(problem, {0.5 + 0.05 + 0.02, 1.0, 0.2}), 0.02, 1e-12);
  EXPECT_NEAR(distance_at(problem, {-1.0, 0.4, 0.0}), 0.3, 1e-12);
}

TEST_F(MoveItProblemsTest, FixedFramesCarryTheirObjects) {
  // As moveit::core::Transforms::copyTransforms() has them: each frame in the planning frame, which
  // is the child of all, itself among them.
  const std::string table = R"(
fixed_frame_transforms:
  - header: {frame_id: map}
    child_frame_id: map
    transform: {translation: [0, 0, 0], rotation: [0, 0, 0, 1]}
  - header: {frame_id: table}
    child_frame_id: map
    transform: {translation: [0, 0, 0.7], rotation: [0, 0, 0, 1]}
  - header: {frame_id: pedestal}
    child_frame_id: map
    transform: {translation: [2, 0, 0.5], rotation: [0, 0, 0, 1]}
)";
  const auto problems =
      read(replaced(kScene, "frame_id: world", "frame_id: table") + table, kRequest);
  ASSERT_TRUE(problems) << problems.error().describe();
  // From the robot's foot the ball is at (-1 - 2, 0, 0.7 - 0.5).
  EXPECT_NEAR(distance_at(problems->front(), {-3.0, 0.0, 0.5}), 0.2, 1e-12);
  EXPECT_THAT(mistake(replaced(kScene + table,
                               "child_frame_id: map\n    transform: "
                               "{translation: [2",
                               "child_frame_id: table\n    transform: {translation: [2"),
                      kRequest),
              HasSubstr("'map' was that before"));
  // As tf has them, the other way round: the planning frame would be a link that may move.
  const std::string arm = R"(
fixed_frame_transforms:
  - header: {frame_id: world}
    child_frame_id: arm
    transform: {translation: [0, 0, 0.7], rotation: [0, 0, 0, 1]}
)";
  EXPECT_THAT(mistake(kScene + arm, kRequest), HasSubstr("the planning frame is 'arm', a link"));
  // Where frames are listed, `world` is one of them or none.
  EXPECT_THAT(mistake(kScene + table, kRequest), HasSubstr("'world' is neither"));
  EXPECT_THAT(mistake(replaced(kScene, "frame_id: world", "frame_id: tray"), kRequest),
              HasSubstr("'tray' is neither the robot's root 'pedestal'"));
}

TEST_F(MoveItProblemsTest, JointsThatARequestLeavesOutAreWhereTheSceneHasThem) {
  const std::string request = replaced(
      replaced(kRequest, "[elbow, finger, shoulder]", "[shoulder]"), "[0.1, 0.04, 0.3]", "[0.3]");
  const auto problems = read(replaced(kScene, "[9, 9]", "[9, 0.25]"), request);
  ASSERT_TRUE(problems) << problems.error().describe();
  EXPECT_EQ(problems->front().q_start, Eigen::Vector2d(0.3, 0.25));
}

TEST_F(MoveItProblemsTest, MeshesAreFoundByTheirResourcesAndScaled) {
  (void)folder_.write("shapes/meshes/wedge.obj",
                      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  const std::string mesh = R"(
      meshes: [{resource: "package://shapes/meshes/wedge.obj", dimensions: [2, 2, 2]}]
      mesh_poses: [{position: [5, 0, 0], orientation: [0, 0, 0, 1]}]
)";
  const auto problems = read(kScene + mesh, kRequest);
  ASSERT_TRUE(problems) << problems.error().describe();
  // The wedge's edge along x ends at x = 5 + 2.
  EXPECT_NEAR(distance_at(problems->front(), {7.5, 0.0, 0.0}), 0.5, 1e-12);
  EXPECT_LT(distance_at(problems->front(), {5.2, 0.2, 0.2}), 0.0);
  EXPECT_THAT(mistake(kScene + replaced(mesh, "wedge.obj", "none.obj"), kRequest),
              HasSubstr("meshes[0].resource`: there is no file"));
}

TEST_F(MoveItProblemsTest, NamesFileLineAndEntryOfAMistake) {
  const std::string cone = mistake(replaced(kScene, "type: box", "type: cone"), kRequest);
  EXPECT_THAT(cone, HasSubstr("scene0007.yaml:11:"));
  EXPECT_THAT(cone, HasSubstr("`world.collision_objects[0].primitives[0].type`"));
  EXPECT_THAT(cone, HasSubstr("found 'cone'"));
  const std::pair<std::string, std::string> in_scenes[] = {
      {"dimensions: [0.1]", "dimensions: [0]"},
      {"dimensions: [0.2, 0.4, 0.6]", "dimensions: [0.2, 0.4]"},
      {"orientation: [0, 0, 0, 1]}", "orientation: [0, 0, 0, 0]}"},
      {"position: {x: 1, y: 0, z: 0}", "position: {x: 1, y: 0}"},
      {"[9, 9]", "[9]"}};
  const char* const told[] = {"must be greater than 0", "list of 3 numbers", "no orientation",
                              "there is no `z`", "2 names and 1 positions"};
  for (std::size_t i = 0; i < std::size(in_scenes); ++i) {
    const auto& [what, by] = in_scenes[i];
    EXPECT_THAT(mistake(replaced(kScene, what, by), kRequest), HasSubstr(told[i])) << by;
  }
  const std::string unknown =
      mistake(kScene, replaced(kRequest, "joint_name: elbow", "joint_name: wrist"));
  EXPECT_THAT(unknown, HasSubstr("request0007.yaml:"));
  EXPECT_THAT(unknown, HasSubstr("'elbow'"));
}

TEST_F(MoveItProblemsTest, RefusesWhatItWouldHaveToLeaveOut) {
  EXPECT_THAT(mistake(replaced(kScene, "robot_state:",
                               "robot_state:\n  attached_collision_objects: [{link_name: hand}]"),
                      kRequest),
              HasSubstr("attached objects"));
  EXPECT_THAT(mistake(kScene + std::string("      planes: [{coef: [0, 0, 1, 0]}]\n"), kRequest),
              HasSubstr("planes"));
  EXPECT_THAT(mistake(kScene, kRequest + std::string("    position_constraints: [{weight: 1}]\n")),
              HasSubstr("positions of joints"));
  EXPECT_THAT(mistake(kScene, kRequest + std::string("  - joint_constraints: []\n")),
              HasSubstr("one goal"));
}

/// Each of these was read before as if it were not there.
TEST_F(MoveItProblemsTest, RefusesWhatItDoesNotKnow) {
  const std::pair<std::string, std::string> in_scenes[] = {
      {"  collision_objects:", "  colision_objects:"},
      {"primitive_poses: [{", "primitve_poses: [{"},
      {"dimensions: [0.1]", "dimensions: [0.1], scale: 2"},
      {"      primitives: [{type: SPHERE, dimensions: [0.1]}]\n", ""},
      {"orientation: {x: 0, y: 0, z: 0, w: 1}", "orientation: {x: 0, y: 0, z: 0, w: 1, W: 0}"},
      {"[0, 0, 0, 1]}]", "[0, 0, 0, 1], scale: [2, 2, 2]}]"},
      {"header: {frame_id: world}", "header: {frame_id: world, frame: tray}"},
      {"name: [shoulder, elbow]", "name: [elbow, elbow]"},
      {"world:", "is_diff: true\nworld:"},
      {"world:", "link_padding: [{link_name: arm, padding: 0.1}]\nworld:"},
      {"robot_state:",
       "robot_state:\n  multi_dof_joint_state: {joint_names: [root], transforms: "
       "[{translation: [1, 0, 0], rotation: [0, 0, 0, 1]}]}"},
      {"world:", "octomap: {}\nworld:"}};
  const char* const told[] = {
      "scene0007.yaml:6:3: unknown key 'colision_objects' in `world` (did "
      "you mean 'collision_objects'?)",
      "unknown key 'primitve_poses' in `world.collision_objects[1]`",
      "unknown key 'scale' in `world.collision_objects[1].primitives[0]`",
      "there are no `primitives` for these poses",
      "unknown key 'W'",
      "unknown key 'scale' in `world.collision_objects[1].primitive_poses[0]`",
      "unknown key 'frame' in `world.collision_objects[1].header`",
      "joint 'elbow' stands here twice",
      "this is only what changes a scene",
      "links are taken as they are",
      "the robot's root is not where the planning frame is",
      "unknown key 'octomap'"};
  for (std::size_t i = 0; i < std::size(in_scenes); ++i) {
    const auto& [what, by] = in_scenes[i];
    EXPECT_THAT(mistake(replaced(kScene, what, by), kRequest), HasSubstr(told[i])) << by;
  }
  const std::pair<std::string, std::string> in_requests[] = {
      {"group_name: arm", "path_constraints: {orientation_constraints: [{link_name: arm}]}"},
      {"group_name: arm",
       "trajectory_constraints: {constraints: [{joint_constraints: [{joint_name: elbow}]}]}"},
      {"group_name: arm", "goal_constraint: []"},
      {"{joint_name: elbow, position: -0.1}",
       "{joint_name: elbow, position: -0.1}\n      - {joint_name: elbow, position: 0.1}"},
      {"position: [0.1, 0.04, 0.3]", "position: [0.1, 0.04, 0.3]\n    velocity: [0, 0, 0.2]"}};
  const char* const told_of_requests[] = {
      "`path_constraints.orientation_constraints`: constraints on the way are not supported",
      "`trajectory_constraints.constraints[0].joint_constraints`: constraints on the way",
      "request0007.yaml:7:1: unknown key 'goal_constraint' (did you mean 'goal_constraints'?)",
      "joint 'elbow' stands here twice", "only motions from rest are supported"};
  for (std::size_t i = 0; i < std::size(in_requests); ++i) {
    const auto& [what, by] = in_requests[i];
    EXPECT_THAT(mistake(kScene, replaced(kRequest, what, by)), HasSubstr(told_of_requests[i]))
        << by;
  }
}

TEST_F(MoveItProblemsTest, RefusesHalvesAndTwinsOfProblems) {
  ASSERT_TRUE(read(kScene, kRequest));
  const auto mistake_with = [&](const std::string& file, const std::string& content) {
    const std::string name = "cubby_reacher/" + file;
    (void)folder_.write(name, content);
    const auto problems = read_moveit_family(folder_.path() / "cubby_reacher", reacher());
    std::filesystem::remove(folder_.path() / name);
    return problems ? "" : problems.error().describe();
  };
  EXPECT_THAT(mistake_with("scene0008.yaml", kScene), HasSubstr("there is no request0008.yaml"));
  EXPECT_THAT(mistake_with("request0008.yml", kRequest), HasSubstr("there is no scene0008.yaml"));
  EXPECT_THAT(mistake_with("request_other0007.yaml", kRequest),
              HasSubstr("there is another request of this number"));
  EXPECT_EQ(mistake_with("scene_sensed0007.yaml", "nothing of a scene"), "");
  (void)folder_.write("cubby_reacher/scene0000000001.yaml", kScene);
  EXPECT_THAT(mistake_with("request0000000001.yaml", kRequest),
              HasSubstr("the number has more than 9 digits"));
}

TEST_F(MoveItProblemsTest, ReadsFamiliesInFoldersInOrderOfNamesAndNumbers) {
  for (const char* family : {"b_reacher", "a"}) {
    for (const char* number : {"0010", "0002"}) {
      (void)folder_.write(std::string("sets/") + family + "/scene_seen" + number + ".yaml", kScene);
      (void)folder_.write(std::string("sets/") + family + "/request" + number + ".yaml", kRequest);
    }
    (void)folder_.write(std::string("sets/") + family + "/config.yaml", "samples: 2\n");
  }
  const auto read = read_problem_set(folder_.path() / "sets", reacher());
  ASSERT_TRUE(read) << read.error().describe();
  std::vector<std::string> found;
  for (const SetProblem& problem : *read) {
    found.push_back(problem.family + std::to_string(problem.index));
  }
  EXPECT_THAT(found, ::testing::ElementsAre("a2", "a10", "b2", "b10"));
  // Of two scenes the plain one counts.
  (void)folder_.write("sets/a/scene0002.yaml",
                      replaced(kScene, "frame_id: world", "frame_id: tray"));
  EXPECT_THAT(read_problem_set(folder_.path() / "sets", reacher()).error().describe(),
              HasSubstr("'tray'"));
  (void)folder_.write("sets/a/scene0002.yaml", kScene);
  (void)folder_.write("sets/a/request0011.yaml", kRequest);
  EXPECT_THAT(read_problem_set(folder_.path() / "sets", reacher()).error().describe(),
              HasSubstr("no scene0011.yaml"));
}

TEST_F(MoveItProblemsTest, AgreesWithTheNeutralForm) {
  const auto theirs = read(kScene, kRequest);
  ASSERT_TRUE(theirs) << theirs.error().describe();
  // The same shapes, their poses multiplied by hand.
  const auto file = folder_.write("cubby.json", R"({"format": "mbm-neutral/1", "family": "cubby",
    "joint_names": ["shoulder", "elbow"], "problems": [{"index": 7, "start": [0.3, 0.1],
    "goals": [[-0.3, -0.1]], "obstacles": [
     {"name": "crate/0", "type": "box", "size": [0.2, 0.4, 0.6], "position": [0.5, 0, 0.2],
      "quaternion_xyzw": [0, 0, 0.7071067811865476, 0.7071067811865476]},
     {"name": "crate/1", "type": "cylinder", "radius": 0.05, "height": 0.3,
      "position": [0.5, 1, 0.2],
      "quaternion_xyzw": [0, 0, 0.7071067811865476, 0.7071067811865476]},
     {"name": "ball", "type": "sphere", "radius": 0.1, "position": [-1, 0, 0],
      "quaternion_xyzw": [0, 0, 0, 1]}]}]})");
  const auto ours = read_problem_set(file, reacher());
  ASSERT_TRUE(ours) << ours.error().describe();
  ASSERT_EQ(ours->size(), theirs->size());
  const SetProblem &a = ours->front(), &b = theirs->front();
  EXPECT_EQ(a.family, b.family);
  EXPECT_EQ(a.index, b.index);
  EXPECT_EQ(a.q_start, b.q_start);
  EXPECT_EQ(a.q_goal, b.q_goal);
  ASSERT_EQ(a.scene->objects().size(), b.scene->objects().size());
  for (std::size_t i = 0; i < a.scene->objects().size(); ++i) {
    const SceneObject &one = a.scene->objects()[i], &other = b.scene->objects()[i];
    EXPECT_EQ(one.name, other.name);
    EXPECT_EQ(shape_name(one.shape), shape_name(other.shape));
    EXPECT_TRUE(one.T_world_object(0.0).isApprox(other.T_world_object(0.0), 1e-12)) << one.name;
  }
  for (const double x : {-1.3, 0.1, 0.6, 0.9}) {
    const Eigen::Vector3d p(x, 0.3, 0.25);
    EXPECT_NEAR(distance_at(a, p), distance_at(b, p), 1e-12);
  }
}

}  // namespace
}  // namespace sidestep
