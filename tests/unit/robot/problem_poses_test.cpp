// Starts and goals of MotionBenchMaker's problems, which are free of collisions for the robots' own
// meshes: an independent check of a profile's kinematics, shapes and spheres.

#include <gtest/gtest.h>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/motion_check.hpp>
#include <sidestep/problems/problem_set.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/shape_check.hpp>
#include "support/host_fixture.hpp"

namespace sidestep {
namespace {

const std::filesystem::path kProblems = std::filesystem::path(SIDESTEP_SHARED_DATA) / "mbm";

class ProblemPoses : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kProblems)) GTEST_SKIP() << "no data at " << kProblems;
    const auto reading = read_configuration(
        std::string(SIDESTEP_SOURCE_DIR) + "/configs/peers/mbm_" + GetParam() + ".yaml", {},
        fixture_.documents);
    ASSERT_TRUE(reading.errors.empty()) << reading.errors.front().describe();
    auto robot = host_.create<RobotModel>(*reading.configuration.root.find("robot"));
    ASSERT_TRUE(robot) << robot.error().describe();
    robot_ = std::move(*robot);
    auto problems = read_problem_set(kProblems / GetParam(), robot_->description());
    ASSERT_TRUE(problems) << problems.error().describe();
    ASSERT_GE(problems->size(), 350u);
    problems_ = std::move(*problems);
  }

  /// How many starts and goals `is_free(problem, q)` refuses; names them.
  template <class IsFree>
  int count_refused(const IsFree& is_free) {
    int refused = 0;
    for (const SetProblem& problem : problems_) {
      for (const auto& [q, which] :
           {std::pair(&problem.q_start, "start"), {&problem.q_goal, "goal"}}) {
        if (is_free(problem, *q)) continue;
        ++refused;
        std::cout << problem.family << " " << problem.index << ", " << which << "\n";
      }
    }
    return refused;
  }

  testing_support::HostFixture fixture_{{}};
  Host host_{{{PLUGIN_FOLDER}, {SIDESTEP_SOURCE_DIR "/robots"}, {}, 0},
             fixture_.log,
             fixture_.clock,
             fixture_.workers,
             fixture_.documents};
  std::shared_ptr<const RobotModel> robot_;
  std::vector<SetProblem> problems_;
};

/// A robot that stands still.
Trajectory standing(const Eigen::VectorXd& q) {
  Trajectory still;
  still.dof = static_cast<int>(q.size());
  still.times_s = {0.0};
  still.positions.assign(q.begin(), q.end());
  still.velocities.assign(still.positions.size(), 0.0);
  return still;
}

TEST_P(ProblemPoses, AreFreeByTheShapes) {
  const auto is_valid = [&](const SetProblem& problem, const Eigen::VectorXd& q) {
    ShapeObstacles truth;
    truth.scene = problem.scene;
    const auto check = make_shape_check(robot_, truth, {});
    const auto verdict = (*check)->check(standing(q), 0.0, Deadline());
    if (!verdict->valid()) std::cout << verdict->describe() << ": ";
    return verdict->valid();
  };
  EXPECT_EQ(count_refused(is_valid), 0);
}

// VAMP's spheres for the Panda refuse one of these poses, those for Fetch seven.
TEST_P(ProblemPoses, AreFreeByTheSpheres) {
  const Eigen::AlignedBox3d bounds_m(Eigen::Vector3d::Constant(-3.0),
                                     Eigen::Vector3d::Constant(3.0));
  const SpacePolicy space{.unknown = Space::kFree, .outside = Space::kFree};
  const auto is_clear = [&](const SetProblem& problem, const Eigen::VectorXd& q) {
    auto field = std::make_shared<SceneField>(*problem.scene, Stamp(), bounds_m);
    MotionCheck check(robot_, std::move(field), space, 0.0);
    return check.is_clear(std::span(q.data(), static_cast<std::size_t>(q.size())));
  };
  EXPECT_EQ(count_refused(is_clear), 0);
}

INSTANTIATE_TEST_SUITE_P(Robots, ProblemPoses, ::testing::Values("panda", "fetch"),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace sidestep
