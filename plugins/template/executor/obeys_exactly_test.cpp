#include "obeys_exactly.hpp"

#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/conformance/executor_conformance.hpp>
#include <sidestep/conformance/test_host.hpp>

namespace {

using namespace sidestep;
using namespace sidestep::conformance;

/// The parameter `start`, as a configuration has it.
Node start_at(const std::vector<std::pair<std::string, std::string>>& positions) {
  Node::Map start;
  for (const auto& [joint, position] : positions) {
    Node::Entry& entry = start.emplace_back();
    entry.key = joint;
    entry.value = Node(Node::Scalar{position, false}, SourceMark());
  }
  return {std::move(start), SourceMark()};
}

TEST(ObeysExactly, IsWhereTheCubicIs) {
  ManualClock clock;
  TestHost host(1, {.robot = robot_without_head(), .clock = &clock});
  const auto executor =
      *obeys_exactly::create({.start = start_at({{"y", "2.0"}, {"x", "1.0"}})}, host.context());
  const RobotState from{Eigen::Vector2d(1.0, 2.0), Eigen::Vector2d::Zero()};
  const RobotState to{Eigen::Vector2d(1.6, 1.5), Eigen::Vector2d::Zero()};
  ASSERT_TRUE(executor->follow(straight_line(from, to, 2, 2.0), clock.now()));
  clock.advance_s(0.5);
  // After the share s = 1/4 of its time: 3 s^2 - 2 s^3 of the way, 6 s (1 - s) of its mean speed.
  const auto measured = executor->current();
  ASSERT_TRUE(measured);
  EXPECT_EQ(measured->stamp, clock.now());
  EXPECT_NEAR(measured->state.q[0], 1.0 + 0.6 * 5.0 / 32.0, 1e-12);
  EXPECT_NEAR(measured->state.q[1], 2.0 - 0.5 * 5.0 / 32.0, 1e-12);
  EXPECT_NEAR(measured->state.qdot[0], 0.3 * 9.0 / 8.0, 1e-12);
}

TEST(ObeysExactly, HasTheJointsOfItsRobot) {
  TestHost host(1, {.robot = robot_without_head()});
  const auto wrong = obeys_exactly::create({.start = start_at({{"z", "1.0"}})}, host.context());
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().code, ErrorCode::kConfig);
  TestHost without;
  EXPECT_FALSE(obeys_exactly::create({}, without.context()));
}

}  // namespace
