#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>

#include "conformance/analytic_models.hpp"
#include "support/sampled_field.hpp"

namespace sidestep {
namespace {

/// A ball of 0.5 m in a cube of +-1 m of which the part above z = 0.7 m was never seen.
class FieldPolicyTest : public testing::Test {
 protected:
  struct Answer {
    double distance_m;
    Eigen::Vector3d gradient;
    FieldStatus status;
  };

  Answer ask(SpacePolicy policy, const Eigen::Vector3d& point_m) const {
    Answer answer{};
    query_with_policy(field_, policy, {&point_m, 1}, {&answer.distance_m, 1}, {&answer.gradient, 1},
                      {&answer.status, 1});
    // Without gradients the distances are the same.
    double distance_m = 0.0;
    FieldStatus status{};
    query_with_policy(field_, policy, {&point_m, 1}, {&distance_m, 1}, {}, {&status, 1});
    EXPECT_EQ(distance_m, answer.distance_m);
    EXPECT_EQ(status, answer.status);
    return answer;
  }

  conformance::BallField field_{{{Eigen::Vector3d::Zero(), 0.5}}, 1.0, 0.7};
};

TEST_F(FieldPolicyTest, LeavesKnownSpaceAlone) {
  for (const Space space : {Space::kFree, Space::kOccupied}) {
    const Answer answer = ask({space, space}, {0.8, 0.0, 0.0});
    EXPECT_NEAR(answer.distance_m, 0.3, 1e-12);
    EXPECT_TRUE(answer.gradient.isApprox(Eigen::Vector3d::UnitX()));
    EXPECT_EQ(answer.status, FieldStatus::kKnown);
  }
}

TEST_F(FieldPolicyTest, CutsUnknownSpaceToZeroWhereItCountsAsOccupied) {
  const Eigen::Vector3d unseen(0.0, 0.0, 0.9);
  const Answer free = ask({Space::kFree, Space::kFree}, unseen);
  EXPECT_NEAR(free.distance_m, 0.4, 1e-12);
  EXPECT_EQ(free.status, FieldStatus::kUnknown);
  const Answer occupied = ask({Space::kOccupied, Space::kFree}, unseen);
  EXPECT_EQ(occupied.distance_m, 0.0);
  EXPECT_TRUE(occupied.gradient.isApprox(Eigen::Vector3d::UnitZ()));
}

TEST_F(FieldPolicyTest, LeavesDistancesBelowZeroInUnknownSpace) {
  const conformance::BallField field({{Eigen::Vector3d::Zero(), 0.5}}, 1.0, -2.0);
  const Eigen::Vector3d inside(0.2, 0.0, 0.0);
  double distance_m = 0.0;
  FieldStatus status{};
  query_with_policy(field, {Space::kOccupied, Space::kFree}, {&inside, 1}, {&distance_m, 1}, {},
                    {&status, 1});
  EXPECT_NEAR(distance_m, -0.3, 1e-12);
}

TEST_F(FieldPolicyTest, MeasuresTheWayBackWhereOutsideCountsAsOccupied) {
  const SpacePolicy policy{Space::kFree, Space::kOccupied};
  const Answer side = ask(policy, {-1.25, 0.2, 0.3});
  EXPECT_NEAR(side.distance_m, -0.25, 1e-12);
  EXPECT_TRUE(side.gradient.isApprox(Eigen::Vector3d::UnitX()));
  EXPECT_EQ(side.status, FieldStatus::kOutside);
  const Answer corner = ask(policy, {1.3, 1.4, 0.0});
  EXPECT_NEAR(corner.distance_m, -0.5, 1e-12);
  EXPECT_TRUE(corner.gradient.isApprox(Eigen::Vector3d(-0.6, -0.8, 0.0)));
}

TEST_F(FieldPolicyTest, IsInfinitelyClearWhereOutsideCountsAsFree) {
  const Answer answer = ask({Space::kOccupied, Space::kFree}, {0.0, 0.0, 5.0});
  EXPECT_EQ(answer.distance_m, kInfinity);
  EXPECT_TRUE(answer.gradient.isZero(0.0));
}

TEST_F(FieldPolicyTest, NeverTakesWhatIsNoPointForFreeSpace) {
  const GridSpec grid{Eigen::Vector3d::Zero(), 0.1, Eigen::Vector3i::Constant(8)};
  const auto field =
      testing_support::sampled_field(grid, [](const Eigen::Vector3d&) { return 1.0; });
  const Eigen::Vector3d point_m(0.1, std::numeric_limits<double>::quiet_NaN(), 0.1);
  double distance_m = 0.0;
  FieldStatus status{};
  query_with_policy(*field, {Space::kFree, Space::kFree}, {&point_m, 1}, {&distance_m, 1}, {},
                    {&status, 1});
  EXPECT_TRUE(std::isnan(distance_m));
}

TEST_F(FieldPolicyTest, DecidesWhatIsOutsideOrUnknownInAFieldOfInfinity) {
  const GridSpec grid{Eigen::Vector3d::Zero(), 0.125, Eigen::Vector3i::Constant(8)};
  const auto field =
      testing_support::sampled_field(grid, [](const Eigen::Vector3d&) { return kInfinity; });
  PointFloats points_m{};  // at a corner of the grid, but for the first, 0.5 m beyond a side
  points_m.x[0] = 1.5F;
  points_m.y[0] = points_m.z[0] = 0.5F;
  const double limit_m = 0.25;
  std::vector<FieldSample> samples(kFloatLanes);
  const auto below = [&](const SpacePolicy& policy) {
    return query_below_with_policy(*field, policy, {&points_m, 1}, {&limit_m, 1}, samples);
  };
  ASSERT_GE(below({Space::kFree, Space::kOccupied}), 1U);
  EXPECT_EQ(samples[0].point, 0U);
  EXPECT_NEAR(samples[0].distance_m, -0.5, 1e-12);
  EXPECT_TRUE(samples[0].gradient.isApprox(-Eigen::Vector3d::UnitX()));
  EXPECT_TRUE(below({Space::kFree, Space::kFree}) == 0U || samples[0].point != 0U);
}

}  // namespace
}  // namespace sidestep
