#include "keep_side.hpp"

#include <gtest/gtest.h>

#include <sidestep/conformance/analytic_models.hpp>
#include <sidestep/conformance/cost_conformance.hpp>

namespace {

using namespace sidestep;
using namespace sidestep::conformance;

std::shared_ptr<const RobotModel> arm() {
  return std::make_shared<PlanarRobot>(PlanarRobot::Shape{.rotary_joints = 3, .mobile = true});
}

/// The end of the arm is to be where x + y >= 0.5.
keep_side::Options options() {
  return {"link_3", Eigen::Vector3d(0.5, 0.0, 0.0), Eigen::Vector3d(1.0, 1.0, 0.0), 0.1};
}

TEST(KeepSide, IsTheDistanceBehindThePlane) {
  const keep_side::KeepSide cost(arm(), 3, options());
  // Stretched out along x, the last link begins 0.6 m before the base.
  const States behind{5, {-1.1, 0.0, 0.0, 0.0, 0.0}, std::vector<double>(5), {0.0}};
  EXPECT_NEAR(evaluate(cost, behind).residuals[0], 1.0 / std::sqrt(2.0) / 0.1, 1e-12);
  const States before{5, {0.1, 0.0, 0.0, 0.0, 0.0}, std::vector<double>(5), {0.0}};
  EXPECT_EQ(evaluate(cost, before).residuals[0], 0.0);
}

}  // namespace
