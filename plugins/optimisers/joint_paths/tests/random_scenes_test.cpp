// Paths among random primitives, judged by FCL on the URDF's shapes over continuous time: an oracle
// that knows nothing of spheres, fields or joint spaces.

#include <gtest/gtest.h>

#include <iostream>
#include <random>
#include <string>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/shape_check.hpp>

#include "support.hpp"
#include "support/hsr.hpp"

namespace sidestep::joint_paths {
namespace {

constexpr int kScenes = 12;
constexpr int kLeastSolved = 8;  // some goals are walled in
constexpr double kHall_m = 3.0;
constexpr double kFarthestTurn_rad = 3.0;

struct Case {
  const char* robot;
  const char* planner;
  const char* checker;
};

class RandomScenes : public testing::TestWithParam<Case> {
 protected:
  RandomScenes() : robot_(testing_support::load_profile(GetParam().robot)) {}

  [[nodiscard]] bool is_mobile() const { return std::string(GetParam().robot) == "hsr"; }
  double draw(double lower, double upper) {
    return std::uniform_real_distribution<double>(lower, upper)(random_);
  }

  Shape draw_shape() {
    switch (std::uniform_int_distribution<int>(0, 2)(random_)) {
      case 0: return Box{{draw(0.05, 0.4), draw(0.05, 0.4), draw(0.05, 0.6)}};
      case 1: return Cylinder{draw(0.03, 0.15), draw(0.1, 0.8)};
      default: return Sphere{draw(0.05, 0.15)};
    }
  }

  /// Primitives around an arm that is fixed at the origin, or over the ground that a base drives.
  std::shared_ptr<const Scene> draw_scene() {
    std::vector<SceneObject> objects;
    for (int i = 0; i < (is_mobile() ? 12 : 8); ++i) {
      const double radius_m = is_mobile() ? draw(0.0, 2.0) : draw(0.4, 0.9);
      const double angle_rad = draw(-M_PI, M_PI);
      Transform pose = Transform::Identity();
      pose.translation() << radius_m * std::cos(angle_rad), radius_m * std::sin(angle_rad),
          draw(0.1, 1.1);
      pose.linear() = Eigen::AngleAxisd(draw(-M_PI, M_PI),
                                        Eigen::Vector3d(draw(-1, 1), draw(-1, 1), 1).normalized())
                          .toRotationMatrix();
      objects.push_back({std::string("object ") += std::to_string(i), draw_shape(), {{0.0, pose}}});
    }
    return std::make_shared<const Scene>(std::move(objects));
  }

  /// A configuration that is clear by the spheres with 5 mm to spare.
  RobotState draw_state(const Problem& problem) {
    const std::vector<Joint>& joints = robot_->description().joints;
    const auto dof = static_cast<Eigen::Index>(joints.size());
    RobotState state{Eigen::VectorXd::Zero(dof), Eigen::VectorXd::Zero(dof)};
    do {
      for (Eigen::Index j = 0; j < dof; ++j) {
        const Joint& joint = joints[static_cast<std::size_t>(j)];
        const double limit = joint.type == Joint::Type::kPrismatic ? 1.8 : kFarthestTurn_rad;
        state.q[j] = draw(std::max(joint.lower, -limit), std::min(joint.upper, limit));
      }
    } while (state_violation(robot_, problem.field, problem.space, 0.005,
                             {state.q.data(), joints.size()}));
    return state;
  }

  Problem draw_problem() {
    scene_ = draw_scene();
    const Eigen::AlignedBox3d bounds_m(Eigen::Vector3d::Constant(-kHall_m),
                                       Eigen::Vector3d::Constant(kHall_m));
    Problem problem;
    problem.robot = robot_;
    problem.field = std::make_shared<SceneField>(*scene_, Stamp(), bounds_m);
    problem.space = {Space::kFree, Space::kFree};
    problem.start = draw_state(problem);
    problem.goal = draw_state(problem);
    problem.support_states = 10;
    problem.dt_s = 0.5;
    problem.qc = Eigen::VectorXd::Ones(robot_->description().dof());
    return problem;
  }

  [[nodiscard]] Verdict judge(const Trajectory& trajectory) const {
    ShapeObstacles obstacles;
    obstacles.scene = scene_;
    const auto check = make_shape_check(robot_, obstacles, {});
    return (*check)->check(trajectory, 0.0, Deadline()).value();
  }

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const Scene> scene_;
  std::mt19937 random_{20240607};
};

TEST_P(RandomScenes, AreCrossedOnPathsThatFclCallsValid) {
  conformance::RecordingLog log;
  double took_ms = 0.0;
  int solved = 0;
  int searched = 0;
  for (int i = 0; i < kScenes; ++i) {
    const Problem problem = draw_problem();
    const auto optimiser =
        make_planner(GetParam().planner, GetParam().checker, static_cast<std::uint64_t>(i), log);
    const auto solution = optimiser->solve(problem, Trajectory{}, Deadline());
    ASSERT_TRUE(solution) << solution.error().describe();
    took_ms += solution->solve_ms;
    if (solution->status != SolveStatus::kConverged) continue;
    ++solved;
    searched += solution->iterations > 0 ? 1 : 0;
    const Verdict verdict = judge(solution->trajectory);
    EXPECT_TRUE(verdict.valid()) << "scene " << i << ": " << verdict.describe();
    EXPECT_EQ(solution->trajectory.q(0)[0], problem.start.q[0]);
    EXPECT_EQ(solution->trajectory.q(solution->trajectory.size() - 1)[0], problem.goal.q[0]);
  }
  std::cout << solved << " of " << kScenes << " solved, " << searched << " of them by search, in "
            << took_ms << " ms\n";
  EXPECT_GE(solved, kLeastSolved);
  EXPECT_GE(searched, kScenes / 4);
}

std::vector<Case> cases() {
  std::vector<Case> cases;
  for (const char* robot : {"panda", "hsr"}) {
    for (const char* planner : {"rrt_connect", "RRTConnect", "BITstar"}) {
      for (const char* checker : {"field", "primitives"})
        cases.push_back({robot, planner, checker});
    }
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(Planners, RandomScenes, testing::ValuesIn(cases()), [](const auto& test) {
  return std::string(test.param.robot) + test.param.planner + "By" + test.param.checker;
});

}  // namespace
}  // namespace sidestep::joint_paths
