#include "goals.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "support/hsr.hpp"

namespace sidestep::ros1_executor {
namespace {

class Seeds : public ::testing::Test {
 protected:
  [[nodiscard]] Transform palm_at(const Eigen::VectorXd& q) const {
    std::vector<Transform> T_world_link(robot_->description().links.size());
    Scratch scratch;
    robot_->link_poses({q.data(), static_cast<std::size_t>(q.size())}, T_world_link, scratch);
    return T_world_link[static_cast<std::size_t>(palm_)];
  }
  /// A named pose with the base somewhere.
  [[nodiscard]] Eigen::VectorXd posture(const char* name, double x, double y, double yaw) const {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(8);
    const auto& positions = robot_->description().find_pose(name)->positions;
    for (std::size_t j = 0; j < positions.size(); ++j) {
      if (positions[j]) q[static_cast<Eigen::Index>(j)] = *positions[j];
    }
    q.head<3>() << x, y, yaw;
    return q;
  }

  std::shared_ptr<const RobotModel> robot_ = testing_support::load_hsr();
  int palm_ = robot_->description().link_index("hand_palm_link").value();
  OdometryOptions base_;
};

/// Where a named posture reaches exactly, it does, or another that does, wherever the base has to
/// stand for it.
TEST_F(Seeds, FindAPostureThatReaches) {
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> place(-3.0, 3.0);
  for (const char* name : {"reach_table", "reach_shelf", "reach_floor", "neutral"}) {
    for (int i = 0; i < 20; ++i) {
      const Eigen::VectorXd wanted =
          posture(name, place(generator), place(generator), place(generator));
      const Eigen::VectorXd now =
          posture("go", place(generator), place(generator), place(generator));
      const Transform target = palm_at(wanted);
      const auto seed = reach_seed(*robot_, {palm_, target, true}, base_, std::nullopt, now);
      EXPECT_TRUE(palm_at(seed).isApprox(target, 1e-6)) << name;
      EXPECT_LE(std::abs(seed[2] - now[2]), 3.1416) << "the shorter way round";
    }
  }
}

/// Above or below, the base stands and is turned as if the lift could be brought there.
TEST_F(Seeds, StandWhereOnlyTheHeightIsOff) {
  Transform target = palm_at(posture("reach_table", 1.0, 0.5, 0.3));
  target.translation().z() -= 0.15;
  const Eigen::VectorXd now = posture("go", 0.0, 0.0, 0.0);
  const auto seed = reach_seed(*robot_, {palm_, target, true}, base_, std::nullopt, now);
  const Transform reached = palm_at(seed);
  EXPECT_TRUE(reached.linear().isApprox(target.linear(), 1e-6));
  EXPECT_TRUE(reached.translation().head<2>().isApprox(target.translation().head<2>(), 1e-6));
  EXPECT_LE(std::abs(reached.translation().z() - target.translation().z()), 0.15 + 1e-6);
}

TEST_F(Seeds, KeepTheBaseInTheBoxWhereTheyCan) {
  const Eigen::VectorXd now = posture("go", 0.0, 0.0, 0.0);
  const Eigen::VectorXd wanted = posture("reach_table", 0.9, 0.0, 0.0);
  const Transform target = palm_at(wanted);
  // From the other sides, the palm may be turned as it likes.
  const KeepInBox box{{-5.0, 0.3}, {5.0, 5.0}};
  const auto seed = reach_seed(*robot_, {palm_, target, false}, base_, box, now);
  EXPECT_GE(seed[1], 0.3);
  EXPECT_LE((palm_at(seed).translation() - target.translation()).head<2>().norm(), 1e-6);
}

TEST_F(Seeds, AreWithinTheLimits) {
  Eigen::VectorXd now = posture("go", 0.0, 0.0, 0.0);
  now[3] = -1e-4;  // as measured
  const Transform target = palm_at(posture("go", 0.3, 0.0, 0.0));
  const auto seed = reach_seed(*robot_, {palm_, target, true}, base_, std::nullopt, now);
  const auto& joints = robot_->description().joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    EXPECT_GE(seed[static_cast<Eigen::Index>(j)], joints[j].lower) << joints[j].name;
    EXPECT_LE(seed[static_cast<Eigen::Index>(j)], joints[j].upper) << joints[j].name;
  }
}

}  // namespace
}  // namespace sidestep::ros1_executor
