#include <cmath>

#include <gmock/gmock.h>

#include <sidestep/trajectory/write_trajectory.hpp>

#include "certify_testing.hpp"
#include "inputs.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class Motions : public ::testing::Test {
 protected:
  /// The only motion of a file.
  [[nodiscard]] static Result<PolynomialMotion> only(const std::filesystem::path& file,
                                                     const MotionFormat& format = {}) {
    auto motions = read_motions(file, testing_certify::crane(0.1)->description(), format);
    if (!motions) return tl::make_unexpected(motions.error());
    EXPECT_EQ(motions->size(), 1U);
    return std::move(motions->front().motion);
  }
  [[nodiscard]] Result<PolynomialMotion> read_message(const std::string& text) const {
    return only(folder_.write("motion.yaml", text));
  }
  [[nodiscard]] Result<SceneInput> read_scene(const std::string& text) const {
    return read_certified_scene(folder_.write("scene.yaml", text),
                                testing_certify::crane(0.1)->description(), {});
  }
  [[nodiscard]] Result<PolynomialMotion> read(const std::string& text) const {
    return only(folder_.write("motion.csv", text));
  }
  [[nodiscard]] std::string mistake(const std::string& text) const {
    const auto motion = read(text);
    return motion ? "" : motion.error().describe();
  }
  testing_support::TemporaryFolder folder_;
};

TEST_F(Motions, AreJoinedLinearlyInWhateverOrderTheColumnsStand) {
  const auto motion =
      read("# of a planner\nslide, time_s, turn\n0.5, 10, 0\n0.7, 12, -1\n1, 13, 1\n");
  ASSERT_TRUE(motion) << motion.error().describe();
  ASSERT_EQ(motion->pieces.size(), 2U);
  EXPECT_EQ(motion->duration_s(), 3.0);
  EXPECT_NEAR(motion->pieces[0].coefficients[0][1], -0.5, 1e-12);
  EXPECT_NEAR(motion->pieces[0].coefficients[1][0], 0.5, 1e-12);
  EXPECT_NEAR(motion->pieces[0].coefficients[1][2], 0.0, 1e-12);
  EXPECT_TRUE(motion->has_times);
}

TEST_F(Motions, MayBeginWithAMarkOfUtf8) {
  EXPECT_TRUE(read("\xEF\xBB\xBFtime_s,turn,slide\n0,0,0.5\n1,1,0.5\n"));
}

TEST_F(Motions, WithVelocitiesAreCubics) {
  const auto motion =
      read("time_s,turn,slide,turn.velocity,slide.velocity\n0,0,0.5,1,0\n2,1,0.5,0,0\n");
  ASSERT_TRUE(motion) << motion.error().describe();
  const auto& c = motion->pieces[0].coefficients[0];
  EXPECT_NEAR(c[0] + 2 * c[1] + 4 * c[2] + 8 * c[3], 1.0, 1e-12);
  EXPECT_NEAR(c[1] + 4 * c[2] + 12 * c[3], 0.0, 1e-12);
  EXPECT_EQ(c[1], 1.0);
}

TEST_F(Motions, WithoutTimesTakeThoseOfTheCommand) {
  const auto file = folder_.write("motion.csv", "turn,slide\n0,0.5\n1,0.5\n2,0.5\n");
  const auto motion = only(file, {{}, {}, 0.25});
  ASSERT_TRUE(motion) << motion.error().describe();
  EXPECT_TRUE(motion->has_times);
  EXPECT_EQ(motion->duration_s(), 0.5);
  const auto twice = folder_.write("motion.csv", "time_s,turn,slide\n0,0,0.5\n1,1,0.5\n");
  EXPECT_THAT(only(twice, {{}, {}, 0.25}).error().describe(), HasSubstr("--step_s says others"));
}

TEST_F(Motions, WithoutTimesAreWaypoints) {
  const auto motion = read("turn,slide\n0,0.5\n3.5,0.5\n");
  ASSERT_TRUE(motion) << motion.error().describe();
  EXPECT_FALSE(motion->has_times);
}

TEST_F(Motions, NameFileAndLineOfWhatIsWrong) {
  EXPECT_THAT(mistake("time_s,turn\n0,0\n1,1\n"),
              AllOf(HasSubstr("there is no column slide"), HasSubstr("--fixed slide=VALUE")));
  EXPECT_THAT(mistake("time_s,turn,slide,elbow\n"), HasSubstr("moves no joint 'elbow'"));
  EXPECT_THAT(mistake("turn,turn,slide\n"), HasSubstr("column turn stands twice"));
  EXPECT_THAT(mistake("time_s,turn,slide\n0,0,0.5\n0,1,0.5\n"),
              HasSubstr("motion.csv:3: time does not go on"));
  EXPECT_THAT(mistake("time_s,turn,slide\n0,0,0.5\n1,nan,0.5\n"),
              HasSubstr("field 2, 'nan', is not a number"));
  EXPECT_THAT(mistake("time_s,turn,slide\n0,0,0.5\n1,1\n"), HasSubstr("2 fields where"));
  EXPECT_THAT(mistake("time_s,turn,slide\n0,0,0.5\n"), HasSubstr("two lines"));
  EXPECT_THAT(mistake("turn,slide,turn.velocity\n"), HasSubstr("no column slide.velocity"));
  EXPECT_THAT(mistake(""), HasSubstr("motion.csv: a motion has two lines"));
  EXPECT_THAT(only(folder_.write("motion.xyz", "1 2 3")).error().describe(),
              HasSubstr("a motion is .csv, "));
}

Trajectory written() {
  return {2, {0.0, 1.0 / 3.0, 1.25}, {0.1, 0.5, -0.2, 0.6, 0.3, 0.55}, {0, 0, 0.7, -0.1, 0, 0}};
}

TEST_F(Motions, ThatWereWrittenAreReadAsTheyWere) {
  const Trajectory trajectory = written();
  for (const std::string kind : {"csv", "json", "yaml"}) {
    const auto file = folder_.path() / "of" / ("motion." + kind);
    const auto is_written = write_trajectory(trajectory, {"turn", "slide"}, file);
    ASSERT_TRUE(is_written) << is_written.error().describe();
    const auto motion = only(file);
    ASSERT_TRUE(motion) << motion.error().describe();
    ASSERT_EQ(motion->pieces.size(), 2U);
    const double resolution_s = kind == "csv" ? 0.0 : 0.5e-9;
    for (const double time_s : {0.0, 0.1, 0.3, 0.9, 1.25}) {
      Eigen::Vector2d q, qdot;
      trajectory.sample(time_s, {q.data(), 2}, {qdot.data(), 2});
      const PolynomialPiece& piece = motion->pieces[time_s < 1.0 / 3.0 ? 0 : 1];
      const double t = time_s - piece.begin_s;
      for (std::size_t j = 0; j < 2; ++j) {
        const auto& c = piece.coefficients[j];
        EXPECT_NEAR(c[0] + t * (c[1] + t * (c[2] + t * c[3])), q[static_cast<int>(j)],
                    1e-12 + 4 * resolution_s)
            << kind << " at " << time_s;
      }
    }
    EXPECT_NEAR(motion->pieces[0].end_s, 1.0 / 3.0, resolution_s);
  }
}

TEST_F(Motions, AreNotWrittenWhereTheyWouldNotBeReadBack) {
  const auto refusal = [&](const Trajectory& trajectory, const std::vector<std::string>& joints,
                           const std::filesystem::path& file) {
    const auto is_written = write_trajectory(trajectory, joints, file);
    return is_written ? "written" : is_written.error().describe();
  };
  const auto file = folder_.path() / "motion.csv";
  EXPECT_THAT(refusal(written(), {"turn"}, file), HasSubstr("has 2 joints, and 1 are named"));
  EXPECT_THAT(refusal(written(), {"turn", "sli,de"}, file), HasSubstr("'sli,de' cannot be"));
  EXPECT_THAT(refusal(written(), {"turn", "slide"}, folder_.path() / "motion.npy"),
              HasSubstr("motion.npy: a trajectory is written as .csv"));
  EXPECT_THAT(refusal({2, {0.0, 0.0}, {0, 0, 0, 0}, {0, 0, 0, 0}}, {"turn", "slide"}, file),
              HasSubstr("time"));
  EXPECT_THAT(refusal(written(), {"turn", "slide"}, "/proc/motion.csv"),
              HasSubstr("/proc/motion.csv: cannot be written"));
  EXPECT_FALSE(std::filesystem::exists(file));
}

constexpr const char* kTrajectory = R"(joint_trajectory:
  header: {seq: 0, stamp: {secs: 0, nsecs: 0}, frame_id: base}
  joint_names: [slide, turn]
  points:
    - positions: [0.5, 0.0]
      velocities: [0.0, 0.0]
      accelerations: [0.0, 0.3]
      effort: []
      time_from_start: {secs: 0, nsecs: 0}
    - positions: [0.7, 1.0]
      velocities: [0.0, 0.5]
      accelerations: [0.0, -0.1]
      effort: []
      time_from_start: {secs: 1, nsecs: 500000000}
multi_dof_joint_trajectory:
  joint_names: []
  points: []
---
)";

TEST_F(Motions, OfMoveItGoThroughTheirStates) {
  const auto motion = read_message(kTrajectory);
  ASSERT_TRUE(motion) << motion.error().describe();
  EXPECT_EQ(motion->joining, Joining::kQuintic);
  ASSERT_EQ(motion->pieces.size(), 1U);
  EXPECT_EQ(motion->duration_s(), 1.5);
  const auto& c = motion->pieces[0].coefficients[0];
  double q = 0.0, v = 0.0, a = 0.0;
  for (int k = 0; k < 6; ++k) {
    q += c[k] * std::pow(1.5, k);
    if (k > 0) v += k * c[k] * std::pow(1.5, k - 1);
    if (k > 1) a += k * (k - 1) * c[k] * std::pow(1.5, k - 2);
  }
  EXPECT_NEAR(q, 1.0, 1e-12);
  EXPECT_NEAR(v, 0.5, 1e-12);
  EXPECT_NEAR(a, -0.1, 1e-12);
  EXPECT_EQ(c[0], 0.0);
  EXPECT_EQ(c[1], 0.0);
  EXPECT_EQ(c[2], 0.15);
}

TEST_F(Motions, OfMoveItAreReadInRos2sWordsAndAsDisplayed) {
  std::string text = kTrajectory;
  for (const auto& [ros1, ros2] : {std::pair("nsecs", "nanosec"), std::pair("secs", "sec")}) {
    for (auto at = text.find(ros1); at != std::string::npos; at = text.find(ros1)) {
      text.replace(at, std::string(ros1).size(), ros2);
    }
  }
  EXPECT_TRUE(read_message(text));
  std::string shown = "model_id: crane\ntrajectory:\n  - ";
  for (const char c : text.substr(0, text.find("---"))) {
    shown += c;
    if (c == '\n') shown += "    ";
  }
  const auto displayed = read_message(shown);
  EXPECT_TRUE(displayed) << displayed.error().describe();
}

TEST_F(Motions, OfMoveItNameWhatIsWrong) {
  EXPECT_THAT(read_message("trajectory_start: {attached_collision_objects: [{link_name: tip}]}\n" +
                           std::string(kTrajectory))
                  .error()
                  .describe(),
              HasSubstr("motion.yaml:1:"));
  // What the scene has attached is a link.
  EXPECT_TRUE(read_message(
      "trajectory_start: {attached_collision_objects: [{link_name: arm, object: {id: tip}}]}\n" +
      std::string(kTrajectory)));
  std::string other = kTrajectory;
  other.replace(other.find("turn"), 4, "lift");
  EXPECT_THAT(read_message(other).error().describe(),
              HasSubstr("motion.yaml:3:24: robot 'crane' moves no joint 'lift'"));
  std::string stands = kTrajectory;
  stands.replace(stands.find("secs: 1, nsecs: 500000000"), 25, "secs: 0, nsecs: 0");
  EXPECT_THAT(read_message(stands).error().describe(), HasSubstr("time does not go on"));
}

constexpr const char* kScene = R"(name: ""
robot_state: {attached_collision_objects: []}
world:
  collision_objects:
    - header: {frame_id: base}
      pose: {position: {x: 1, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0.7071067811865476, w: 0.7071067811865476}}
      id: shelf
      primitives: [{type: 1, dimensions: [0.1, 0.2, 0.3]}, {type: 3, dimensions: [0.5, 0.05]}]
      primitive_poses:
        - {position: {x: 0.5, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0, w: 1}}
        - {position: {x: 0, y: 0, z: 1}, orientation: {x: 0, y: 0, z: 0, w: 1}}
      meshes: []
      planes: []
  octomap: {octomap: {data: []}}
)";

TEST_F(Motions, PassScenesOfMoveIt) {
  const auto scene = read_scene(kScene);
  ASSERT_TRUE(scene) << scene.error().describe();
  ASSERT_EQ(scene->apart_from.scene.objects().size(), 2U);
  const Transform T = scene->apart_from.scene.objects()[0].T_world_object(0.0);
  EXPECT_TRUE(T.translation().isApprox(Eigen::Vector3d(1.0, 0.5, 0.0), 1e-12));
  EXPECT_TRUE(T.linear().col(0).isApprox(Eigen::Vector3d::UnitY(), 1e-9));
  const auto& cylinder = std::get<Cylinder>(scene->apart_from.scene.objects()[1].shape);
  EXPECT_EQ(cylinder.length_m, 0.5);
  EXPECT_EQ(cylinder.radius_m, 0.05);
}

/// As the service /get_planning_scene answers.
TEST_F(Motions, PassScenesThatServicesAnswerWith) {
  std::stringstream lines(kScene);
  std::string answer = "scene:\n";
  for (std::string line; std::getline(lines, line);) answer += "  " + line + "\n";
  const auto scene = read_scene(answer);
  ASSERT_TRUE(scene) << scene.error().describe();
  EXPECT_EQ(scene->apart_from.scene.objects().size(), 2U);
}

TEST_F(Motions, RefuseScenesOfWhichSomethingWouldBeLeftOut) {
  const auto mistake = [&](const std::string& old, const std::string& fresh) {
    std::string text = kScene;
    text.replace(text.find(old), old.size(), fresh);
    const auto scene = read_scene(text);
    return scene ? "" : scene.error().describe();
  };
  EXPECT_THAT(mistake("data: []", "data: [1]"), HasSubstr("octomaps are not supported"));
  EXPECT_THAT(mistake("objects: []", "objects: [{}]"), HasSubstr("there is no `object`"));
  EXPECT_THAT(mistake("type: 3", "type: 4"), HasSubstr("expected box, cylinder or sphere"));
  EXPECT_THAT(mistake("frame_id: base", "frame_id: map"), HasSubstr("'map' is neither"));
  EXPECT_THAT(mistake("planes: []", "planes: [{}]"), HasSubstr("planes are not supported"));
  for (const char* const is_diff : {"is_diff: true", "is_diff: True", "is_diff: 1"}) {
    EXPECT_THAT(mistake("name: \"\"", is_diff), HasSubstr("only what changes a scene"));
  }
  EXPECT_THAT(mistake("name: \"\"", "link_padding: [{link_name: arm, padding: 0.01}]"),
              HasSubstr("scene.yaml:1:42: `link_padding[0].padding`: links are taken as they are"));
  const std::string base =
      "{translation: {x: 0, y: 0, z: 0.5}, rotation: {x: 0, y: 0, z: 0, w: 1}}";
  EXPECT_THAT(mistake("attached_collision_objects: []",
                      "multi_dof_joint_state: {transforms: [" + base + "]}"),
              HasSubstr("root is not where the planning frame is"));
  EXPECT_THAT(read_scene(" \n").error().describe(), HasSubstr("scene.yaml: is empty"));
  EXPECT_THAT(read_certified_scene(folder_.path(), testing_certify::crane(0.1)->description(), {})
                  .error()
                  .describe(),
              HasSubstr("a scene is .yaml"));
  EXPECT_THAT(mistake("id: shelf", "id: shelf\n      operation: 1"), HasSubstr("is removed"));
}

}  // namespace
}  // namespace sidestep
