#include <gtest/gtest.h>

#include <sidestep/planning/validity_check.hpp>

namespace sidestep {
namespace {

using Kind = Violation::Kind;

TEST(Violation, SaysWhatWhereAndByHowMuch) {
  EXPECT_EQ((Violation{Kind::kCollision, "arm_roll_link", "an obstacle", 2.354, 0.0131}.describe()),
            "arm_roll_link is 0.013 m inside an obstacle at 2.35 s");
  EXPECT_EQ((Violation{Kind::kCollision, "base_link", "", 0.0, 0.2}.what()),
            "base_link is 0.200 m inside an obstacle");
  EXPECT_EQ((Violation{Kind::kSelfCollision, "hand", "base", 1.0, 0.004}.describe()),
            "hand is 0.004 m inside base at 1.00 s");
  EXPECT_EQ((Violation{Kind::kPositionLimit, "elbow", "its upper limit of 2.2 rad", 1.0, 0.125}
                 .describe()),
            "elbow is 0.125 beyond its upper limit of 2.2 rad at 1.00 s");
  EXPECT_EQ((Violation{Kind::kVelocityLimit, "elbow", "", 1.0, 0.5}.describe()),
            "elbow is 0.5 beyond its limit at 1.00 s");
  EXPECT_EQ((Violation{Kind::kUnproven, "hand", "obstacles", 3.0, 1e-5}.describe()),
            "hand could not be shown clear of obstacles at 3.00 s");
}

TEST(Verdict, IsOneSentence) {
  Verdict verdict;
  verdict.outcome = Verdict::Outcome::kValid;
  verdict.min_clearance_m = 0.0421;
  EXPECT_EQ(verdict.describe(), "valid, 0.042 m clear");
  verdict.clearance_is_bound = true;
  EXPECT_EQ(verdict.describe(), "valid, at least 0.042 m clear");
  verdict.min_clearance_m = std::numeric_limits<double>::infinity();
  EXPECT_EQ(verdict.describe(), "valid, nothing near");
  verdict.outcome = Verdict::Outcome::kUnproven;
  verdict.violations = {{Kind::kUnproven, "hand", "obstacles", 3.0, 1e-5}};
  EXPECT_EQ(verdict.describe(),
            "not shown to be valid: hand could not be shown clear of obstacles at 3.00 s");
  verdict.outcome = Verdict::Outcome::kInvalid;
  verdict.violations.assign(5, {Kind::kCollision, "hand", "an obstacle", 1.0, 0.01});
  EXPECT_EQ(verdict.describe(),
            "invalid: hand is 0.010 m inside an obstacle at 1.00 s; hand is 0.010 m inside an "
            "obstacle at 1.00 s; hand is 0.010 m inside an obstacle at 1.00 s; and 2 more");
}

TEST(Names, AreStable) {
  EXPECT_EQ(to_string(Kind::kCollision), "collision");
  EXPECT_EQ(to_string(Kind::kSelfCollision), "self_collision");
  EXPECT_EQ(to_string(Kind::kPositionLimit), "position_limit");
  EXPECT_EQ(to_string(Kind::kVelocityLimit), "velocity_limit");
  EXPECT_EQ(to_string(Kind::kUnproven), "unproven");
  EXPECT_EQ(to_string(Verdict::Outcome::kValid), "valid");
  EXPECT_EQ(to_string(Verdict::Outcome::kInvalid), "invalid");
  EXPECT_EQ(to_string(Verdict::Outcome::kUnproven), "unproven");
}

}  // namespace
}  // namespace sidestep
