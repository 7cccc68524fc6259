#include "conformance/robot_conformance.hpp"
#include "robot_testing.hpp"

namespace sidestep {
namespace {

using testing_robot::link_pose;

/// A row of Denavit-Hartenberg parameters: Rz(theta) Tz(d) Tx(a) Rx(alpha).
struct DhRow {
  double d_m;
  double a_m;
  double alpha_rad;
};

/// The manufacturer's, universal-robots.com, "Parameters for calculations of kinematics and
/// dynamics".
constexpr DhRow kRows[] = {{0.1625, 0.0, M_PI_2}, {0.0, -0.425, 0.0},     {0.0, -0.3922, 0.0},
                           {0.1333, 0.0, M_PI_2}, {0.0997, 0.0, -M_PI_2}, {0.0996, 0.0, 0.0}};

/// The flange in the frame of the base plate, which is turned by pi against base_link.
Transform flange_by_dh(const std::vector<double>& q) {
  Transform T(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()));
  for (std::size_t j = 0; j < 6; ++j) {
    T.rotate(Eigen::AngleAxisd(q[j], Eigen::Vector3d::UnitZ()));
    T.translate(Eigen::Vector3d(kRows[j].a_m, 0.0, kRows[j].d_m));
    T.rotate(Eigen::AngleAxisd(kRows[j].alpha_rad, Eigen::Vector3d::UnitX()));
  }
  return T;
}

class Ur5e : public ::testing::Test {
 protected:
  void SetUp() override {
    robot_ = loader_.load_or_fail("{profile: ur5e}");
    ASSERT_NE(robot_, nullptr);
  }
  testing_robot::Loader loader_;
  std::unique_ptr<KinematicTree> robot_;
};

TEST_F(Ur5e, Conforms) {
  conformance::check_robot(*robot_);
  EXPECT_EQ(robot_->description().dof(), 6);
}

TEST_F(Ur5e, FollowsThePublishedParameters) {
  const auto samples = conformance::random_configurations(robot_->description(), 50, 5);
  for (auto q = samples.begin(); q != samples.end(); q += 6) {
    const std::vector<double> sample(q, q + 6);
    const Transform T = link_pose(*robot_, sample, "tool0");
    EXPECT_LT((T.matrix() - flange_by_dh(sample).matrix()).norm(), 1e-9);
  }
}

TEST_F(Ur5e, HasThePublishedLimits) {
  for (const Joint& joint : robot_->description().joints) {
    const double turn_rad = joint.name == "elbow_joint" ? M_PI : 2.0 * M_PI;
    EXPECT_NEAR(joint.upper, turn_rad, 1e-9) << joint.name;
    EXPECT_NEAR(joint.lower, -turn_rad, 1e-9) << joint.name;
    EXPECT_NEAR(joint.max_velocity, M_PI, 1e-9) << joint.name;
    EXPECT_NEAR(joint.max_acceleration, M_PI, 1e-9) << joint.name;
  }
}

// The data sheet's reach, to the wrist's middle.
TEST_F(Ur5e, ReachesWhatTheDataSheetSays) {
  const std::vector<double> stretched = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  const Eigen::Vector3d wrist = link_pose(*robot_, stretched, "wrist_2_link").translation();
  const Eigen::Vector3d shoulder = link_pose(*robot_, stretched, "shoulder_link").translation();
  EXPECT_NEAR((wrist - shoulder).norm(), 0.85, 0.02);
}

TEST_F(Ur5e, PointsItsFlangeDownWhenReady) {
  const auto q = testing_robot::pose_of(robot_->description(), "ready");
  const Transform T = link_pose(*robot_, q, "tool0");
  EXPECT_LT((T.linear().col(2) + Eigen::Vector3d::UnitZ()).norm(), 1e-4);
  EXPECT_NEAR(T.translation().x(), 0.49, 0.01);
  EXPECT_NEAR(T.translation().z(), 0.49, 0.01);
}

}  // namespace
}  // namespace sidestep
