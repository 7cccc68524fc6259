#include <sidestep/core/index.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

#include <limits>

#include "conformance/robot_conformance.hpp"
#include "support/allocation_counter.hpp"

namespace sidestep {
namespace {

struct Parts {
  RobotDescription robot;
  std::vector<TreeJoint> joints;
  Result<std::unique_ptr<KinematicTree>> create() const {
    return KinematicTree::create(robot, joints);
  }
};

TreeJoint rotation(const std::string& name, int joint, const Eigen::Vector3d& offset_m,
                   const Eigen::Vector3d& axis) {
  TreeJoint out;
  out.name = name;
  out.motion = TreeJoint::Motion::kRotation;
  out.T_parent_joint.translate(offset_m);
  out.axis = axis.normalized();
  out.joint = joint;
  return out;
}

/// Two links of 1 m that turn about z, a bracket fixed at an angle, and a slide that mimics the
/// first joint backwards.
Parts planar_arm() {
  Parts parts;
  parts.robot.name = "arm";
  parts.robot.joints = {
      {"shoulder", Joint::Type::kContinuous, -kInfinity, kInfinity, 1.0, kInfinity},
      {"elbow", Joint::Type::kRevolute, -2.0, 2.0, 1.0, 5.0}};
  parts.robot.links = {{"root", -1}, {"upper", 0}, {"lower", 1}, {"bracket", 2}, {"slide", 3}};
  TreeJoint bracket;
  bracket.name = "bracket";
  bracket.T_parent_joint.translate(Eigen::Vector3d(1.0, 0.0, 0.0));
  bracket.motion = TreeJoint::Motion::kRotation;  // stands still at 90 degrees
  bracket.offset = M_PI / 2.0;
  TreeJoint slide;
  slide.name = "slide";
  slide.motion = TreeJoint::Motion::kTranslation;
  slide.axis = Eigen::Vector3d::UnitX();
  slide.joint = 0;
  slide.multiplier = -0.5;
  slide.offset = 0.1;
  parts.joints = {TreeJoint{"root"},
                  rotation("shoulder", 0, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ()),
                  rotation("elbow", 1, {1.0, 0.0, 0.0}, Eigen::Vector3d::UnitZ()), bracket, slide};
  parts.robot.spheres = {
      {0, {0, 0, 1}, 0.1}, {1, {0.5, 0, 0}, 0.1}, {2, {0.5, 0, 0}, 0.1}, {4, {0, 0.2, 0.3}, 0.05}};
  return parts;
}

TEST(KinematicTree, MatchesTheClosedFormOfAPlanarArm) {
  const auto tree = planar_arm().create();
  ASSERT_TRUE(tree) << tree.error().describe();
  const double a = 0.7;
  const double b = -1.1;
  std::vector<Eigen::Vector3d> centres(4);
  Scratch scratch;
  (*tree)->sphere_centres(std::vector<double>{a, b}, centres, scratch);
  const auto unit = [](double angle) {
    return Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
  };
  EXPECT_LT((centres[0] - Eigen::Vector3d(0, 0, 1)).norm(), 1e-15);
  EXPECT_LT((centres[1] - 0.5 * unit(a)).norm(), 1e-15);
  EXPECT_LT((centres[2] - unit(a) - 0.5 * unit(a + b)).norm(), 1e-15);
  // The slide runs along the bracket's x, a quarter turn ahead of the lower arm.
  const Eigen::Vector3d ball = unit(a) + unit(a + b) + (0.1 - 0.5 * a) * unit(a + b + M_PI / 2.0) +
                               0.2 * unit(a + b + M_PI) + Eigen::Vector3d(0, 0, 0.3);
  EXPECT_LT((centres[3] - ball).norm(), 1e-14);
}

TEST(KinematicTree, Conforms) { conformance::check_robot(**planar_arm().create()); }

TEST(KinematicTree, ConformsWithSkewAxes) {
  Parts parts = planar_arm();
  parts.joints[0].T_parent_joint = transform_from_xyz_rpy({0.1, 0.2, 0.3}, {0.4, -0.5, 0.6});
  parts.joints[1].axis = Eigen::Vector3d(1, 2, 3).normalized();
  parts.joints[2].axis = Eigen::Vector3d(-3, 1, 0.5).normalized();
  parts.joints[4].axis = Eigen::Vector3d(1, -1, 1).normalized();
  conformance::check_robot(**parts.create());
}

TEST(KinematicTree, TurnsWithoutWrapping) {
  const auto tree = planar_arm().create();
  std::vector<Eigen::Vector3d> once(4), round(4);
  Scratch scratch;
  // The slide mimics the angle itself, so a whole turn more is elsewhere for it alone.
  (*tree)->sphere_centres(std::vector<double>{0.3, 0.2}, once, scratch);
  (*tree)->sphere_centres(std::vector<double>{0.3 + 2.0 * M_PI, 0.2}, round, scratch);
  for (std::size_t s = 0; s < 3; ++s) EXPECT_LT((once[s] - round[s]).norm(), 1e-14);
  EXPECT_NEAR((once[3] - round[3]).norm(), M_PI, 1e-12);
}

TEST(KinematicTree, AllocatesNothingOnceWarm) {
  const auto tree = planar_arm().create();
  const std::vector<double> q(2 * 64, 0.3);
  std::vector<Eigen::Vector3d> centres(4 * 64), jacobians(4 * 64 * 2);
  std::vector<double> gradients(2 * 64);
  std::vector<Transform> poses(5);
  const std::vector<LinkForce> forces(gradients.size() / 2);
  Scratch scratch;
  const auto all = [&] {
    (*tree)->link_poses(std::span(q).first(2), poses, scratch);
    (*tree)->sphere_centres(q, centres, scratch);
    (*tree)->sphere_jacobians(q, centres, jacobians, scratch);
    (*tree)->pull_back(q, forces, gradients, scratch);
  };
  all();
  const int before = testing_support::allocations();
  all();
  EXPECT_EQ(testing_support::allocations(), before);
  const std::vector<double> some(10);
  EXPECT_GT(testing_support::allocations(), before);  // it does count
}

TEST(KinematicTree, TakesShortSpansForFewerRows) {
  const auto tree = planar_arm().create();
  const std::vector<double> q(2 * 3, 0.3);
  std::vector<Eigen::Vector3d> centres(4 * 2 + 1, Eigen::Vector3d::Constant(7.0));
  Scratch scratch;
  (*tree)->sphere_centres(q, centres, scratch);
  EXPECT_NE(centres[7], Eigen::Vector3d::Constant(7.0));
  EXPECT_EQ(centres[8], Eigen::Vector3d::Constant(7.0));
}

struct Contradiction {
  const char* name;
  void (*spoil)(Parts&);
  const char* where;
  const char* message;
};

class KinematicTreeRefuses : public ::testing::TestWithParam<Contradiction> {};

TEST_P(KinematicTreeRefuses, Contradictions) {
  Parts parts = planar_arm();
  GetParam().spoil(parts);
  const auto tree = parts.create();
  ASSERT_FALSE(tree);
  EXPECT_EQ(tree.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(tree.error().where.find(GetParam().where), std::string::npos) << tree.error().where;
  EXPECT_NE(tree.error().message.find(GetParam().message), std::string::npos)
      << tree.error().message;
}

INSTANTIATE_TEST_SUITE_P(
    All, KinematicTreeRefuses,
    ::testing::Values(
        Contradiction{"no_joints", [](Parts& p) { p.robot.joints.clear(); }, "arm", "no planned"},
        Contradiction{"missing_tree_joint", [](Parts& p) { p.joints.pop_back(); }, "arm",
                      "one tree joint per link"},
        Contradiction{"two_roots", [](Parts& p) { p.robot.links[2].parent = -1; }, "lower", "root"},
        Contradiction{"child_first", [](Parts& p) { p.robot.links[1].parent = 3; }, "upper",
                      "after its parent"},
        Contradiction{"same_name", [](Parts& p) { p.robot.links[2].name = "upper"; }, "upper",
                      "used twice"},
        Contradiction{"bad_joint", [](Parts& p) { p.joints[2].joint = 5; }, "lower",
                      "does not exist"},
        Contradiction{"idle_joint", [](Parts& p) { p.joints[2].joint = 0; }, "elbow",
                      "moves no link"},
        Contradiction{"long_axis", [](Parts& p) { p.joints[1].axis *= 2.0; }, "upper",
                      "unit length"},
        Contradiction{"skewed", [](Parts& p) { p.joints[1].T_parent_joint.linear() *= 2.0; },
                      "upper", "rigid"},
        Contradiction{"nan_pose", [](Parts& p) { p.joints[1].T_parent_joint(0, 3) = NAN; }, "upper",
                      "not finite"},
        Contradiction{"swapped_limits", [](Parts& p) { p.robot.joints[1].lower = 3.0; }, "elbow",
                      "lower limit"},
        Contradiction{"no_velocity", [](Parts& p) { p.robot.joints[1].max_velocity = 0.0; },
                      "elbow", "velocity"},
        Contradiction{"weak_brakes", [](Parts& p) { p.robot.joints[1].max_braking = 4.9; }, "elbow",
                      "braking limit"},
        Contradiction{"nan_brakes", [](Parts& p) { p.robot.joints[1].max_braking = NAN; }, "elbow",
                      "braking limit"},
        Contradiction{"endless_brakes", [](Parts& p) { p.robot.joints[1].max_braking = kInfinity; },
                      "elbow", "braking limit"},
        Contradiction{"sphere_off", [](Parts& p) { p.robot.spheres[0].link = 9; }, "arm",
                      "link that does not exist"},
        Contradiction{"no_radius", [](Parts& p) { p.robot.spheres[1].radius_m = 0.0; }, "upper",
                      "radius"},
        Contradiction{"pair_order",
                      [](Parts& p) {
                        p.robot.self_collision_pairs = {{2, 1}};
                      },
                      "arm", "lower"},
        Contradiction{"short_pose",
                      [](Parts& p) {
                        p.robot.poses = {{"half", {0.0}}};
                      },
                      "half", "one entry per joint"}),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace sidestep
