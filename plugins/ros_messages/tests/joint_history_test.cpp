#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../conversions.hpp"

namespace sidestep::ros_messages {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kPi = std::numbers::pi;
const Joint kLift{.name = "arm_lift_joint", .type = Joint::Type::kPrismatic};
const Joint kFlex{.name = "arm_flex_joint", .type = Joint::Type::kRevolute};
const Joint kWheel{.name = "wheel", .type = Joint::Type::kContinuous};

Stamp at_s(double seconds) { return Stamp::from_seconds(seconds); }

TEST(JointHistory, GoesLinearlyBetweenPositions) {
  JointHistory history;
  EXPECT_TRUE(history.add("arm_lift_joint", at_s(2.0), 0.5));
  EXPECT_TRUE(history.add("arm_lift_joint", at_s(1.0), 0.1));  // late
  EXPECT_NEAR(history.position(kLift, at_s(1.25), 1.0).value(), 0.2, 1e-12);
  EXPECT_EQ(history.position(kLift, at_s(1.0), 1.0).value(), 0.1);
  EXPECT_EQ(history.position(kLift, at_s(2.0), 0.0).value(), 0.5) << "no gap at a position's time";
}

TEST(JointHistory, TakesTheShorterWayRoundForContinuousJointsOnly) {
  JointHistory history;
  for (const Joint& joint : {kWheel, kFlex}) {
    history.add(joint.name, at_s(0.0), kPi - 0.1);
    history.add(joint.name, at_s(1.0), -kPi + 0.1);
  }
  EXPECT_NEAR(history.position(kWheel, at_s(0.75), 1.0).value(), kPi + 0.05, 1e-12);
  EXPECT_NEAR(history.position(kFlex, at_s(0.5), 1.0).value(), 0.0, 1e-12);
}

TEST(JointHistory, SaysWhatIsMissing) {
  JointHistory history;
  history.add("arm_lift_joint", at_s(1.0), 0.1);
  history.add("arm_lift_joint", at_s(2.0), 0.2);
  const auto fault = [&](const Joint& joint, double time_s, double max_gap_s) {
    const auto position = history.position(joint, at_s(time_s), max_gap_s);
    EXPECT_FALSE(position);
    EXPECT_THAT(position.error().message, HasSubstr(joint.name));
    return position.error().fault;
  };
  EXPECT_EQ(fault(kLift, 0.9, 9.0), LookupFault::kTooEarly);
  EXPECT_EQ(fault(kLift, 2.1, 9.0), LookupFault::kTooLate);
  EXPECT_EQ(fault(kLift, 1.5, 0.9), LookupFault::kGap);
  EXPECT_EQ(fault(kFlex, 1.5, 9.0), LookupFault::kUnknown);
  const std::vector<Joint> wanted{kFlex, kLift, kWheel};
  EXPECT_THAT(history.missing(wanted), ElementsAre("arm_flex_joint", "wheel"));
  EXPECT_THAT(history.names(), ElementsAre("arm_lift_joint"));
}

TEST(JointHistory, IsFilledByMessagesOfPartsOfTheRobot) {
  JointHistory history;
  const std::vector<Joint> arm{kLift, kFlex};
  const std::vector<Joint> base{kWheel};
  EXPECT_EQ(add_joint_states(to_joint_state(arm, std::vector{0.3, -1.0}, at_s(5.0)), history), 0);
  EXPECT_EQ(add_joint_states(to_joint_state(base, std::vector{9.0}, at_s(6.0)), history), 0);
  EXPECT_EQ(history.position(kFlex, at_s(5.0), 1.0).value(), -1.0);
  EXPECT_EQ(history.position(kWheel, at_s(6.0), 1.0).value(), 9.0);
}

TEST(JointHistory, CountsWhatItCannotUse) {
  JointHistory history;
  const std::vector<Joint> arm{kLift, kFlex, kWheel};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const JointState message = to_joint_state(arm, std::vector{0.3, nan}, at_s(5.0));
  EXPECT_EQ(add_joint_states(message, history), 2) << "one is not finite, one has no position";
  EXPECT_EQ(add_joint_states(message, history), 3) << "one repeats its stamp";
  EXPECT_THAT(history.names(), ElementsAre("arm_lift_joint"));
}

TEST(JointHistory, ForgetsWhatIsNoLongerNeeded) {
  JointHistory history;
  for (int i = 0; i < 10; ++i) history.add("arm_lift_joint", at_s(i), i);
  const double before = history.position(kLift, at_s(6.5), 1.0).value();
  history.forget_before(at_s(6.5));
  EXPECT_EQ(history.position(kLift, at_s(6.5), 1.0).value(), before);
  EXPECT_EQ(history.position(kLift, at_s(5.5), 1.0).error().fault, LookupFault::kTooEarly);
  history.forget_before(at_s(100.0));
  EXPECT_EQ(history.position(kLift, at_s(9.0), 1.0).value(), 9.0) << "the last one stays";
}

}  // namespace
}  // namespace sidestep::ros_messages
