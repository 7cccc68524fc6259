#include <cmath>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/measures/point_survey.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/report/chart.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/statistics.hpp>
#include <sidestep/robot/kinematic_tree.hpp>
#include "plan_parts.hpp"

namespace sidestep {
namespace {

using testing::ElementsAre;

/// Gives `count` frames whose one pixel is the frame's number; every `bad_every`-th is bad.
class CountingSource final : public Source {
 public:
  CountingSource(std::int64_t count, bool tells_count, std::int64_t bad_every = 0)
      : count_(count), tells_count_(tells_count), bad_every_(bad_every) {}

  Result<std::optional<Frame>> next(const Deadline&) override {
    if (given_ == count_) return std::nullopt;
    const std::int64_t number = given_++;
    if (bad_every_ > 0 && number % bad_every_ == 0) return fail(ErrorCode::kBadFrame, "bad");
    Frame frame;
    frame.sequence = number;
    DepthImage image;
    image.camera.width_px = 1;
    image.camera.height_px = 1;
    image.depth_m = {static_cast<float>(number)};
    frame.measurement = std::move(image);
    return frame;
  }
  std::optional<std::int64_t> frame_count() const override {
    return tells_count_ ? std::optional(count_) : std::nullopt;
  }

 private:
  std::int64_t count_;
  bool tells_count_;
  std::int64_t bad_every_;
  std::int64_t given_ = 0;
};

/// Takes every frame; returns how many were usable.
int drain(FrameTap& tap) {
  int usable = 0;
  for (;;) {
    const auto frame = tap.next(Deadline());
    if (!frame) continue;
    if (!*frame) return usable;
    ++usable;
  }
}

std::vector<std::int64_t> kept(const FrameTap& tap) {
  std::vector<std::int64_t> numbers;
  for (const DepthPicture& picture : tap.pictures()) numbers.push_back(picture.frame_sequence);
  return numbers;
}

TEST(FrameTap, SpreadsItsPicturesOverAllFrames) {
  CountingSource source(100, true);
  FrameTap tap(source, source.frame_count(), 0, 4);
  EXPECT_EQ(tap.frame_count(), 100);
  EXPECT_EQ(drain(tap), 100);
  EXPECT_THAT(kept(tap), ElementsAre(0, 25, 50, 75));
}

TEST(FrameTap, EndsTheStreamAtItsLimitCountingBadFrames) {
  CountingSource source(100, true, 2);
  FrameTap tap(source, source.frame_count(), 10, 2);
  EXPECT_EQ(tap.frame_count(), 10);
  EXPECT_EQ(drain(tap), 5);
}

TEST(FrameTap, ThinsOutWhenTheLengthIsNotKnown) {
  CountingSource source(100, false);
  FrameTap tap(source, source.frame_count(), 0, 4);
  EXPECT_FALSE(tap.frame_count());
  EXPECT_EQ(drain(tap), 100);
  EXPECT_THAT(kept(tap), ElementsAre(0, 32, 64, 96));
}

/// Two joints in a row, sliding along x and turning about z.
std::shared_ptr<const RobotModel> two_joints() {
  RobotDescription robot;
  robot.name = "two";
  robot.joints = {{"slide", Joint::Type::kPrismatic, -1.0, 1.0, 1.0, 1.0},
                  {"turn", Joint::Type::kContinuous, -INFINITY, INFINITY, 1.0, 1.0}};
  robot.links = {{"base", -1}, {"hand", 0}};
  TreeJoint slide{"slide"}, turn{"turn"};
  slide.motion = TreeJoint::Motion::kTranslation;
  slide.axis = Eigen::Vector3d::UnitX();
  slide.joint = 0;
  turn.motion = TreeJoint::Motion::kRotation;
  turn.joint = 1;
  auto tree = KinematicTree::create(std::move(robot), {slide, turn});
  EXPECT_TRUE(tree) << tree.error().describe();
  return std::shared_ptr<const RobotModel>(std::move(*tree));
}

Problem two_joint_problem() {
  Problem problem;
  problem.robot = two_joints();
  problem.start = {Eigen::Vector2d(-0.9, 0.0), Eigen::Vector2d::Zero()};
  problem.goal = {Eigen::Vector2d(0.9, 3.0), Eigen::Vector2d::Zero()};
  problem.support_states = 21;
  problem.dt_s = 0.1;
  return problem;
}

TEST(InitialGuess, IsTheStraightLineFirst) {
  const Problem problem = two_joint_problem();
  const Trajectory guess = initial_guess(problem, 0, 5);
  EXPECT_EQ(guess.positions, straight_line(problem.start, problem.goal, 21, 0.1).positions);
}

TEST(InitialGuess, BendsTheSameWayForTheSameSeed) {
  const Problem problem = two_joint_problem();
  const Trajectory guess = initial_guess(problem, 1, 5);
  EXPECT_EQ(guess.positions, initial_guess(problem, 1, 5).positions);
  EXPECT_NE(guess.positions, initial_guess(problem, 1, 6).positions);
  EXPECT_NE(guess.positions, initial_guess(problem, 2, 5).positions);
  EXPECT_NE(guess.positions, initial_guess(problem, 0, 5).positions);
}

TEST(InitialGuess, KeepsItsEndsAndTheLimits) {
  const Problem problem = two_joint_problem();
  for (int attempt = 1; attempt < 20; ++attempt) {
    const Trajectory guess = initial_guess(problem, attempt, 5);
    ASSERT_TRUE(guess.validate());
    EXPECT_THAT(guess.q(0), ElementsAre(-0.9, 0.0));
    EXPECT_THAT(guess.q(20), ElementsAre(0.9, 3.0));
    for (int i = 0; i < guess.size(); ++i) {
      EXPECT_LE(std::abs(guess.q(i)[0]), 1.0);
    }
  }
}

TEST(Percentile, IsLinearBetweenValues) {
  EXPECT_EQ(percentile({}, 0.5), 0.0);
  EXPECT_EQ(percentile({3.0}, 0.95), 3.0);
  EXPECT_EQ(percentile({4.0, 1.0, 2.0, 3.0}, 0.5), 2.5);
  EXPECT_EQ(percentile({4.0, 1.0, 2.0, 3.0}, 1.0), 4.0);
  EXPECT_NEAR(percentile({0.0, 10.0}, 0.95), 9.5, 1e-12);
}

TEST(Ticks, AreRoundAndInside) {
  EXPECT_THAT(ticks({0.0, 1.0}, 6),
              ElementsAre(0.0, 0.2, testing::DoubleEq(0.4), testing::DoubleEq(0.6),
                          testing::DoubleEq(0.8), 1.0));
  EXPECT_THAT(ticks({-7.0, 23.0}, 4), ElementsAre(0.0, 10.0, 20.0));
  EXPECT_EQ(tick_text(0.30000000000000004, 0.1), "0.3");
  EXPECT_EQ(tick_text(0.25, 0.25), "0.25");
  EXPECT_EQ(tick_text(20.0, 10.0), "20");
}

TEST(Ticks, OfLogarithmsArePowersOfTenOrRoundNumbersBetweenThem) {
  EXPECT_THAT(log_ticks({-1.5, 3.2}), ElementsAre(-1.0, 0.0, 1.0, 2.0, 3.0));
  EXPECT_THAT(log_ticks({0.2, 1.5}), ElementsAre(testing::DoubleNear(std::log10(2.0), 1e-12),
                                                 testing::DoubleNear(std::log10(5.0), 1e-12), 1.0,
                                                 testing::DoubleNear(std::log10(20.0), 1e-12)));
}

TEST(PlanSummary, OfARunThatAFaultEndedKeepsWhatWasMeasured) {
  MapRecord map;
  map.steps.resize(3);
  map.fault = Error{ErrorCode::kPlugin, "threw: out of luck", "plugin optimiser", "", nullptr};
  const ExperimentOutcome outcome = summarise_plans({}, map, {});
  EXPECT_FALSE(outcome.success);
  ASSERT_TRUE(outcome.fault);
  EXPECT_EQ(outcome.fault->code, ErrorCode::kPlugin);
  EXPECT_THAT(outcome.verdict, testing::HasSubstr("after 3 frames and 0 plans: plugin optimiser"));
  EXPECT_THAT(outcome.summary_json, testing::HasSubstr("\"frames\": 3"));
  EXPECT_THAT(outcome.summary_json, testing::HasSubstr("threw: out of luck"));
}

TEST(PlanSummary, TellsHowMuchOfTheWayNobodyHasSeen) {
  MapRecord map;
  map.steps.resize(1);
  std::vector<PlanRecord> plans(2);
  for (PlanRecord& plan : plans) plan.field_verdict = Verdict{};
  const auto verdict = [&] { return summarise_plans({}, map, plans).verdict; };
  EXPECT_EQ(verdict().find("seen"), std::string::npos);
  plans[1].field_verdict->unknown_share = 0.406;
  EXPECT_NE(verdict().find("; of one 41 % of the robot's way"), std::string::npos) << verdict();
  plans.erase(plans.begin());
  EXPECT_NE(verdict().find(
                "; 41 % of the robot's way is in space that no frame has seen or outside the map."),
            std::string::npos)
      << verdict();
}

TEST(PlanSummary, OfAnEmptyMapIsAFailure) {
  MapRecord map;
  map.steps.resize(3);
  map.empty_reason = "no frame has a single valid depth";
  const ExperimentOutcome outcome = summarise_plans({}, map, {});
  EXPECT_FALSE(outcome.success);
  EXPECT_EQ(outcome.verdict, "Failed: the map is empty: no frame has a single valid depth.");
}

TEST(PlanSummary, TellsAClearanceFromHowFarWasLooked) {
  MapRecord map;
  map.steps.resize(1);
  std::vector<PlanRecord> plans(1);
  plans[0].field_verdict = Verdict{.min_clearance_m = 0.55, .clearance_is_bound = true};
  plans[0].voxel_verdict = Verdict{.min_clearance_m = 0.5, .clearance_is_bound = true};
  const auto outcome = [&] { return summarise_plans({}, map, plans); };
  EXPECT_THAT(outcome().verdict,
              testing::HasSubstr("is at least 0.500 m clear, as far as was looked"));
  EXPECT_THAT(outcome().table, testing::ContainsRegex("at least +0[.]500 m"));
  plans[0].field_verdict->min_clearance_m = 0.45;  // a field that ends sooner
  EXPECT_THAT(outcome().verdict, testing::HasSubstr("at least 0.450 m clear"));
  plans[0].field_verdict->clearance_is_bound = false;  // an obstacle
  EXPECT_THAT(outcome().verdict, testing::HasSubstr("comes no closer than 0.450 m"));
  plans[0].field_verdict->min_clearance_m = 0.5;
  EXPECT_THAT(outcome().verdict, testing::HasSubstr("comes no closer than 0.500 m"));
}

TEST(PlanSummary, SaysWhichFramesAreNotInTheMap) {
  CountingSource source(100, true);
  FrameTap tap(source, source.frame_count(), 10, 0);
  EXPECT_EQ(tap.left_out(), "");
  drain(tap);
  EXPECT_EQ(tap.left_out(), "mapped the first 10 of 100 frames");
  FrameTap exact(source, 10, 10, 0);
  drain(exact);
  EXPECT_EQ(exact.left_out(), "");
  CountingSource stream(100, false);
  FrameTap of_stream(stream, std::nullopt, 10, 0);
  drain(of_stream);
  EXPECT_EQ(of_stream.left_out(), "mapped the first 10 frames, whether or not there are more");

  MapRecord map;
  map.steps.resize(1);
  map.left_out = tap.left_out();
  std::vector<PlanRecord> plans(1);
  const auto verdict = [&] { return summarise_plans({}, map, plans).verdict; };
  EXPECT_THAT(verdict(), testing::HasSubstr("; mapped the first 10 of 100 frames."));
  plans[0].reason = "it failed";
  EXPECT_THAT(verdict(), testing::HasSubstr("mapped the first 10 of 100 frames."));
}

/// A camera at (1, 2.1, 3) that looks along +x of the world: one point for each depth, straight
/// ahead.
Frame looking_along_x(std::vector<float> depths_m) {
  Frame frame;
  frame.T_world_camera.translation() = Eigen::Vector3d(1.0, 2.1, 3.0);
  frame.T_world_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  DepthImage image;
  image.camera = {static_cast<int>(depths_m.size()), 1, 1e9, 1e9, 0.0, 0.0};
  image.depth_m = std::move(depths_m);
  frame.measurement = std::move(image);
  return frame;
}

TEST(PointSurvey, SaysWherePointsLieAndWhatWouldHoldThem) {
  using Keys = PointSurvey::Keys;
  const GridSpec grid{{40.0, 40.0, 0.0}, 0.5, {8, 8, 4}};
  PointSurvey survey(4.0);
  survey.add(looking_along_x({0.0F, NAN}), grid);
  EXPECT_EQ(survey.describe(grid, Keys::kMapper), "no frame has a single valid depth");
  survey.add(looking_along_x({6.0F, 5.0F}), grid);
  EXPECT_EQ(
      survey.describe(grid, Keys::kMapper),
      "every point is farther from the camera than mapper.max_range_m: 4, the nearest 5.00 m");
  survey.add(looking_along_x({2.25F, 3.25F, 6.0F}), grid);
  EXPECT_FALSE(survey.reaches_grid());
  const std::string text = survey.describe(grid, Keys::kMapper);
  EXPECT_THAT(text, testing::HasSubstr("no point of any frame lies in the map"));
  EXPECT_THAT(text, testing::HasSubstr("from (3.25, 2.10, 3.00) to (4.25, 2.10, 3.00) m"));
  EXPECT_THAT(text, testing::HasSubstr("from (40.00, 40.00, 0.00) to (44.00, 44.00, 2.00) m"));
  EXPECT_THAT(text, testing::HasSubstr(
                        "mapper.origin_m: [2.5, 1.5, 2.5] and mapper.size_vox: [5, 3, 3] would"));
  EXPECT_THAT(survey.describe(grid, Keys::kMappingBenchmark),
              testing::HasSubstr("experiment.extent_m: [2.5, 1.5, 1.5]"));
  // The grid that was named holds them.
  survey.add(looking_along_x({2.25F, 3.25F}), {{2.5, 1.5, 2.5}, 0.5, {5, 3, 3}});
  EXPECT_TRUE(survey.reaches_grid());
}

TEST(TextTable, AlignsItsColumns) {
  TextTable table({"plan", "time"});
  table.add({"über", "1.5 s"});
  table.add({"a", "12.25 s"});
  EXPECT_EQ(table.text(),
            "plan     time\n"
            "-------------\n"
            "über    1.5 s\n"
            "a     12.25 s\n");
}

}  // namespace
}  // namespace sidestep
