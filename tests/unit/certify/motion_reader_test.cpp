#include <fstream>

#include <gmock/gmock.h>

#include "certify_testing.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;

class Motions : public ::testing::Test {
 protected:
  [[nodiscard]] Result<PolynomialMotion> read(const std::string& text) const {
    std::ofstream(file_) << text;
    return read_motion(file_, testing_certify::crane(0.1)->description());
  }
  [[nodiscard]] std::string mistake(const std::string& text) const {
    const auto motion = read(text);
    return motion ? "" : motion.error().describe();
  }
  std::string file_ = ::testing::TempDir() + "sidestep_motion.csv";
};

TEST_F(Motions, AreJoinedLinearlyInWhateverOrderTheColumnsStand) {
  const auto motion =
      read("# of a planner\nslide, time_s, turn\n0.5, 10, 0\n0.7, 12, -1\n1, 13, 1\n");
  ASSERT_TRUE(motion) << motion.error().describe();
  ASSERT_EQ(motion->pieces.size(), 2U);
  EXPECT_EQ(motion->duration_s(), 3.0);
  EXPECT_NEAR(motion->pieces[0].coefficients[0][1], -0.5, 1e-12);
  EXPECT_NEAR(motion->pieces[0].coefficients[1][0], 0.5, 1e-12);
  EXPECT_NEAR(motion->pieces[0].coefficients[1][2], 0.0, 1e-12);
  EXPECT_TRUE(motion->has_times);
}

TEST_F(Motions, WithVelocitiesAreCubics) {
  const auto motion =
      read("time_s,turn,slide,turn.velocity,slide.velocity\n0,0,0.5,1,0\n2,1,0.5,0,0\n");
  ASSERT_TRUE(motion) << motion.error().describe();
  const auto& c = motion->pieces[0].coefficients[0];
  EXPECT_NEAR(c[0] + 2 * c[1] + 4 * c[2] + 8 * c[3], 1.0, 1e-12);
  EXPECT_NEAR(c[1] + 4 * c[2] + 12 * c[3], 0.0, 1e-12);
  EXPECT_EQ(c[1], 1.0);
}

TEST_F(Motions, WithoutTimesAreWaypoints) {
  const auto motion = read("turn,slide\n0,0.5\n3.5,0.5\n");
  ASSERT_TRUE(motion) << motion.error().describe();
  EXPECT_FALSE(motion->has_times);
}

TEST_F(Motions, NameFileAndLineOfWhatIsWrong) {
  EXPECT_THAT(mistake("time_s,turn\n0,0\n1,1\n"), HasSubstr("no column for joint 'slide'"));
  EXPECT_THAT(mistake("time_s,turn,slide,elbow\n"), HasSubstr("has no joint 'elbow'"));
  EXPECT_THAT(mistake("turn,turn,slide\n"), HasSubstr("column turn stands twice"));
  EXPECT_THAT(mistake("time_s,turn,slide\n0,0,0.5\n0,1,0.5\n"),
              HasSubstr("motion.csv:3: time does not go on"));
  EXPECT_THAT(mistake("time_s,turn,slide\n0,0,0.5\n1,nan,0.5\n"),
              HasSubstr("'nan' is not a number"));
  EXPECT_THAT(mistake("time_s,turn,slide\n0,0,0.5\n1,1\n"), HasSubstr("2 fields where"));
  EXPECT_THAT(mistake("time_s,turn,slide\n0,0,0.5\n"), HasSubstr("two lines"));
  EXPECT_THAT(mistake("turn,slide,turn.velocity\n"), HasSubstr("no column slide.velocity"));
  EXPECT_THAT(mistake(""), HasSubstr("two lines"));
}

}  // namespace
}  // namespace sidestep
