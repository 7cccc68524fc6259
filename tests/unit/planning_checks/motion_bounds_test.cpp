#include "motion_bounds.hpp"

#include <gtest/gtest.h>

#include <random>

#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using testing_support::mobile_arm;

class MotionBoundsTest : public testing::Test {
 protected:
  [[nodiscard]] std::vector<double> random_q() {
    std::vector<double> q;
    for (const Joint& joint : robot_->description().joints) {
      const double lower = std::max(joint.lower, -3.0);
      const double upper = std::min(joint.upper, 3.0);
      q.push_back(std::uniform_real_distribution<double>(lower, upper)(random_));
    }
    return q;
  }
  [[nodiscard]] std::vector<Eigen::Vector3d> jacobians(const std::vector<double>& q) {
    std::vector<Eigen::Vector3d> centres(spheres_);
    std::vector<Eigen::Vector3d> columns(spheres_ * dof_);
    robot_->sphere_jacobians(q, centres, columns, scratch_);
    return columns;
  }

  std::shared_ptr<testing_support::ChainRobot> robot_ = mobile_arm();
  std::size_t dof_ = robot_->description().joints.size();
  std::size_t spheres_ = robot_->description().spheres.size();
  MotionBounds bounds_{*robot_};
  std::mt19937 random_{5};
  Scratch scratch_;
};

TEST_F(MotionBoundsTest, HoldForEveryConfiguration) {
  for (int i = 0; i < 2000; ++i) {
    const auto columns = jacobians(random_q());
    for (std::size_t s = 0; s < spheres_; ++s) {
      for (std::size_t j = 0; j < dof_; ++j) {
        ASSERT_LE(columns[s * dof_ + j].norm(),
                  bounds_.sphere_levers(static_cast<int>(s))[j] + 1e-9)
            << "sphere " << s << ", joint " << j;
      }
    }
  }
}

TEST_F(MotionBoundsTest, AreTheKnownLeversOfASimpleChain) {
  // Spheres 7 at the wrist's axis; the wrist turns about x at the end of the fore-arm.
  const auto levers = bounds_.sphere_levers(7);
  EXPECT_NEAR(levers[0], 1.0, 1e-9);            // x
  EXPECT_NEAR(levers[3], 1.0, 1e-9);            // lift
  EXPECT_NEAR(levers[4], 0.35 + 0.3, 1e-9);     // shoulder
  EXPECT_NEAR(levers[5], 0.3, 1e-9);            // elbow
  EXPECT_NEAR(levers[6], 0.0, 1e-9);            // wrist
  EXPECT_EQ(bounds_.sphere_levers(0)[5], 0.0);  // the arm does not move the base
}

TEST_F(MotionBoundsTest, LocalLeversHoldAlongTheMotionAndAreTighter) {
  double widest = 0.0;
  double local = 0.0;
  for (int i = 0; i < 200; ++i) {
    const auto from = random_q();
    const auto towards = random_q();
    const auto start = jacobians(from);
    std::vector<double> variation(dof_);
    for (std::size_t j = 0; j < dof_; ++j) variation[j] = 0.05 * std::abs(towards[j] - from[j]);
    std::vector<double> levers(spheres_ * dof_);
    bounds_.local_levers(start, variation, levers);
    for (int k = 0; k <= 20; ++k) {
      std::vector<double> q(dof_);
      for (std::size_t j = 0; j < dof_; ++j) {
        q[j] = from[j] + 0.05 * (k / 20.0) * (towards[j] - from[j]);
      }
      const auto columns = jacobians(q);
      for (std::size_t e = 0; e < columns.size(); ++e) {
        ASSERT_LE(columns[e].norm(), levers[e] + 1e-9) << "entry " << e;
      }
    }
    for (std::size_t s = 0; s < spheres_; ++s) {
      for (std::size_t j = 0; j < dof_; ++j) {
        widest += bounds_.sphere_levers(static_cast<int>(s))[j];
        local += levers[s * dof_ + j];
      }
    }
  }
  EXPECT_LT(local, 0.9 * widest);
}

TEST_F(MotionBoundsTest, PairLeversBoundTheRateOfEveryDistance) {
  const auto& d = robot_->description();
  constexpr double kStep = 1e-5;
  for (int i = 0; i < 500; ++i) {
    const auto q = random_q();
    for (std::size_t j = 0; j < dof_; ++j) {
      auto moved = q;
      moved[j] += kStep;
      std::vector<Eigen::Vector3d> a(spheres_);
      std::vector<Eigen::Vector3d> b(spheres_);
      robot_->sphere_centres(q, a, scratch_);
      robot_->sphere_centres(moved, b, scratch_);
      for (std::size_t p = 0; p < d.self_collision_pairs.size(); ++p) {
        for (std::size_t s = 0; s < spheres_; ++s) {
          for (std::size_t r = 0; r < spheres_; ++r) {
            if (d.spheres[s].link != d.self_collision_pairs[p].first) continue;
            if (d.spheres[r].link != d.self_collision_pairs[p].second) continue;
            const double rate = std::abs((a[s] - a[r]).norm() - (b[s] - b[r]).norm()) / kStep;
            ASSERT_LE(rate, bounds_.pair_levers(static_cast<int>(p))[j] + 1e-6);
          }
        }
      }
    }
  }
  for (std::size_t p = 0; p < d.self_collision_pairs.size(); ++p) {
    for (const std::size_t base_joint : {0u, 1u, 2u}) {
      EXPECT_EQ(bounds_.pair_levers(static_cast<int>(p))[base_joint], 0.0);
    }
  }
}

}  // namespace
}  // namespace sidestep
