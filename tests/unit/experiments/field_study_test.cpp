#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/results/statistics.hpp>
#include <sidestep/runtime/results_store.hpp>
#include <sidestep/runtime/yaml_document.hpp>
#include "study_parts.hpp"
#include "support/ball_robot.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using testing::HasSubstr;

TEST(Intervals, NormalQuantilesAreThoseOfTables) {
  EXPECT_NEAR(normal_quantile(0.95), 1.959964, 1e-6);
  EXPECT_NEAR(normal_quantile(0.99), 2.575829, 1e-6);
  EXPECT_NEAR(normal_quantile(0.6826895), 1.0, 1e-6);
}

TEST(Intervals, WilsonSolvesItsQuadratic) {
  // The limits are where the score test just rejects: (share - p)^2 = z^2 p (1 - p) / n.
  const double z = 1.959964;
  for (const auto& [hits, trials] : {std::pair(0, 10), {3, 10}, {10, 10}, {14, 15300}}) {
    const Interval interval = wilson_interval(hits, trials, 0.95);
    const double share = static_cast<double>(hits) / trials;
    for (const double p : {interval.lower, interval.upper}) {
      EXPECT_NEAR((share - p) * (share - p), z * z * p * (1.0 - p) / trials, 1e-8);
    }
    EXPECT_LE(interval.lower, share);
    EXPECT_GE(interval.upper, share);
    EXPECT_LT(interval.lower, interval.upper);
  }
  EXPECT_TRUE(std::isnan(wilson_interval(0, 0, 0.95).lower));
}

TEST(Intervals, BootstrapOfEqualClustersHasNoWidthAndOfUnequalOnesSpansThem) {
  const std::vector<double> ones(20, 3.0), counts(20, 2.0);
  const Interval equal = bootstrap_ratio(ones, counts, 500, 0.95, 1);
  EXPECT_DOUBLE_EQ(equal.lower, 1.5);
  EXPECT_DOUBLE_EQ(equal.upper, 1.5);
  // Two clusters of shares 0 and 1: a quarter of the draws is all of one, so both ends are taken.
  const Interval two = bootstrap_ratio(std::vector{0.0, 1.0}, std::vector{1.0, 1.0}, 500, 0.95, 1);
  EXPECT_EQ(two.lower, 0.0);
  EXPECT_EQ(two.upper, 1.0);
  EXPECT_TRUE(std::isnan(bootstrap_ratio({}, {}, 500, 0.95, 1).lower));
}

TEST(Intervals, BootstrapOfAMeanIsAboutTheNormalOne) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(5.0, 2.0);
  std::vector<double> values(400);
  double sum = 0.0;
  for (double& value : values) sum += value = normal(random);
  const std::vector<double> ones(values.size(), 1.0);
  const Interval interval = bootstrap_ratio(values, ones, 4000, 0.95, 9);
  const double half = 1.96 * 2.0 / std::sqrt(400.0);
  EXPECT_NEAR(interval.lower, sum / 400.0 - half, 0.25 * half);
  EXPECT_NEAR(interval.upper, sum / 400.0 + half, 0.25 * half);
}

/// A solved problem: whether each field is collision-free, its iterations and its cost.
ProblemOutcome outcome(std::int64_t problem, bool plain, bool sign, int iterations, double cost) {
  ProblemOutcome row;
  row.problem = problem;
  row.start_free = row.goal_free = true;
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    FieldOutcome& field = row.fields[kind];
    field.attempted = true;
    field.status = SolveStatus::kConverged;
    field.collision_free = kind == kUnsigned ? plain : sign;
    field.iterations = iterations + static_cast<int>(kind);
    field.steps = 2 * field.iterations;
    field.cost = cost + (kind == kSigned ? 0.5 : 0.0);
  }
  return row;
}

/// Two scenes of three pairs: one skipped, one for neither field, one for each alone.
StudyRobotRows hand_made() {
  StudyRobotRows robot;
  robot.name = "ball";
  robot.states = 3;
  robot.scenes = 2;
  robot.planned = 6;
  robot.problems = {outcome(0, true, true, 2, 1.0), outcome(1, true, true, 4, 3.0),
                    outcome(2, false, true, 6, 9.0), outcome(3, true, false, 8, 9.0),
                    outcome(4, false, false, 90, 99.0)};
  robot.problems[4].goal_free = false;
  ProblemOutcome skipped;
  skipped.problem = 5;
  robot.problems.push_back(skipped);
  return robot;
}

/// How intervals are to be drawn.
StudyRecord few_draws() {
  StudyRecord study;
  study.bootstrap_samples = 200;
  study.provenance.seed = 1;
  return study;
}

TEST(StudyComparison, CountsFailuresAmongTheProblemsThatEitherFieldSolves) {
  const auto result = compare_fields(few_draws(), hand_made());
  EXPECT_EQ(result.at("problems"), 6);
  EXPECT_EQ(result.at("skipped"), 1);
  EXPECT_EQ(result.at("start_or_goal_in_collision"), 2);
  EXPECT_EQ(result.at("solved_by_both"), 2);
  EXPECT_EQ(result.at("only_signed"), 1);
  EXPECT_EQ(result.at("only_unsigned"), 1);
  EXPECT_EQ(result.at("neither"), 1);
  EXPECT_EQ(result.at("solvable"), 4);
  for (const char* kind : kFieldNames) {
    const auto& field = result.at(kind);
    EXPECT_EQ(field.at("attempted"), 5);
    EXPECT_EQ(field.at("collision_free"), 3);
    EXPECT_EQ(field.at("failures"), 1);
    EXPECT_EQ(field.at("failure_percent"), 25.0);
    EXPECT_EQ(field.at("ended").at("converged"), 5);
  }
  EXPECT_EQ(result.at("difference").at("failure_percent"), 0.0);
}

TEST(StudyComparison, TakesIterationsOfAllSolvesAndCostsOfThoseValidInBoth) {
  const auto result = compare_fields(few_draws(), hand_made());
  const auto number = [&](const char* pointer) {
    return result.at(nlohmann::ordered_json::json_pointer(pointer)).get<double>();
  };
  EXPECT_EQ(number("/unsigned/iterations/count"), 5);
  EXPECT_DOUBLE_EQ(number("/unsigned/iterations/mean"), (2 + 4 + 6 + 8 + 90) / 5.0);
  EXPECT_EQ(number("/unsigned/iterations_solvable/count"), 4);
  EXPECT_DOUBLE_EQ(number("/unsigned/iterations_solvable/mean"), 5.0);
  EXPECT_EQ(number("/unsigned/valid_cost/count"), 2);
  EXPECT_DOUBLE_EQ(number("/unsigned/valid_cost/mean"), 2.0);
  EXPECT_DOUBLE_EQ(number("/unsigned/valid_cost/sd"), std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(number("/difference/iterations/mean"), 1.0);
  EXPECT_DOUBLE_EQ(number("/difference/valid_cost/mean"), 0.5);
  EXPECT_DOUBLE_EQ(number("/difference/valid_cost/ci/0"), 0.5);
}

TEST(StudyComparison, OfNothingHasNoShare) {
  StudyRobotRows robot;
  robot.states = 3;
  const auto result = compare_fields(few_draws(), robot);
  EXPECT_EQ(result.at("solvable"), 0);
  EXPECT_TRUE(result.at("signed").at("failure_percent").is_null());
}

TEST(StudyRows, ComeBackAsTheyWereAndMayBeAddedTo) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.path() / "results.sqlite";
  StudyRecord study;
  study.identity = "a: 1\nb: 2\n";
  study.shard = {1, 3};
  study.confidence = 0.9;
  study.bootstrap_samples = 123;
  study.provenance.seed = 18446744073709551615ULL;
  study.robots = {hand_made()};
  study.robots[0].dof = 2;
  study.robots[0].drawn_states = {Eigen::Vector2d(1, 2), Eigen::Vector2d(3, 4),
                                  Eigen::Vector2d(5, 6)};
  study.robots[0].published = PublishedComparison{{1, 2, 3, 4, 5}, {6, 7, 8, 9, 10}};
  {
    auto store = ResultsStore::open(file, {});
    ASSERT_TRUE(store);
    Recorder recorder(**store);
    record_study(study, recorder);
    record_session({1.5, 2.5, 2, 4}, 0, recorder);
    record_scene({1, 0.25, {0.5, 0.75}}, 0, recorder);
    for (std::size_t p = 0; p < 4; ++p) record_problem(study.robots[0].problems[p], 0, recorder);
    ASSERT_TRUE(recorder.commit());
  }
  {
    auto store = ResultsStore::reopen(file);
    ASSERT_TRUE(store) << store.error().describe();
    Recorder recorder(**store);
    for (std::size_t p = 4; p < 6; ++p) record_problem(study.robots[0].problems[p], 0, recorder);
    ASSERT_TRUE(recorder.commit());
  }
  const auto read = read_study(file);
  ASSERT_TRUE(read) << read.error().describe();
  EXPECT_EQ(read->identity, study.identity);
  EXPECT_EQ(read->provenance.seed, study.provenance.seed);
  EXPECT_EQ(read->shard.index, 1);
  EXPECT_EQ(read->shard.count, 3);
  EXPECT_EQ(read->bootstrap_samples, 123);
  ASSERT_EQ(read->sessions.size(), 1u);
  EXPECT_EQ(read->sessions[0].problems, 4);
  EXPECT_EQ(read->sessions[0].cpu_s, 2.5);
  const StudyRobotRows& robot = read->robots.at(0);
  EXPECT_EQ(robot.published->signed_field.cost_sd, 10.0);
  EXPECT_EQ(robot.drawn_states, study.robots[0].drawn_states);
  ASSERT_EQ(robot.drawn.size(), 1u);
  EXPECT_EQ(robot.drawn[0].field_ms[kSigned], 0.75);
  ASSERT_EQ(robot.problems.size(), 6u);
  EXPECT_FALSE(robot.problems[5].fields[kSigned].attempted);
  EXPECT_EQ(robot.problems[2].fields[kSigned].cost, 9.5);
  EXPECT_FALSE(robot.problems[2].fields[kUnsigned].collision_free);
  EXPECT_FALSE(robot.problems[4].goal_free);
}

TEST(StudyRows, OfAnotherExperimentAreRefused) {
  const testing_support::TemporaryFolder folder;
  ASSERT_TRUE(ResultsStore::open(folder.path() / "results.sqlite", {}));
  const auto read = read_study(folder.path() / "results.sqlite");
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().describe(), HasSubstr("no 'identity' of 'study'"));
  EXPECT_EQ(ResultsStore::reopen(folder.path() / "none.sqlite").error().code, ErrorCode::kNotFound);
  folder.write("bad.sqlite", "no database at all");
  EXPECT_EQ(ResultsStore::reopen(folder.path() / "bad.sqlite").error().code, ErrorCode::kIo);
}

TEST(StudyRows, DifferencesNameBothSides) {
  EXPECT_EQ(difference("a: 1\nb: 2\n", "a: 1\nb: 2\n"), "");
  EXPECT_EQ(difference("a: 1\n  b: 2\n", "a: 1\n  b: 3\n"), "`b: 2` there, `b: 3` here");
  EXPECT_EQ(difference("a: 1\n", "a: 1\nb: 3\n"), "`nothing` there, `b: 3` here");
}

TEST(StudyPairs, AreEveryPairOnce) {
  std::set<std::pair<int, int>> seen;
  for (std::int64_t pair = 0; pair < 153; ++pair) {
    const auto [first, second] = states_of_pair(pair, 18);
    EXPECT_LT(first, second);
    EXPECT_LT(second, 18);
    EXPECT_TRUE(seen.emplace(first, second).second);
  }
  EXPECT_EQ(states_of_pair(0, 18), std::pair(0, 1));
  EXPECT_EQ(states_of_pair(152, 18), std::pair(16, 17));
}

StudyRobotEntry flat_entry() {
  StudyRobotEntry entry;
  entry.name = "ball";
  entry.box_lower_m = {-2.0, -1.0, 0.3};
  entry.box_upper_m = {2.0, 1.0, 0.3};
  entry.side_lower_m = {0.1, 0.2, 1.0};
  entry.side_upper_m = {0.5, 0.9, 1.0};
  return entry;
}

TEST(StudyScenes, HaveTheirBoxesInTheirRangesWhateverTheOthersAre) {
  const StudyRobotEntry entry = flat_entry();
  std::set<double> sides;
  for (int scene = 0; scene < 50; ++scene) {
    const auto boxes = draw_boxes(entry, 3, scene, 7);
    ASSERT_EQ(boxes.size(), 3u);
    double sum_m = 0.0;
    for (const StudyBox& box : boxes) {
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_GE(box.sizes()[axis], entry.side_lower_m[axis] - 1e-12);
        EXPECT_LE(box.sizes()[axis], entry.side_upper_m[axis] + 1e-12);
        EXPECT_GE(box.center()[axis], entry.box_lower_m[axis] - 1e-12);
        EXPECT_LE(box.center()[axis], entry.box_upper_m[axis] + 1e-12);
      }
      sides.insert(box.sizes().x());
      sum_m += box.sizes().x() + box.sizes().y();
    }
    EXPECT_NEAR(mean_side_m(entry, boxes), sum_m / 6.0, 1e-12) << "z does not vary";
    EXPECT_TRUE(draw_boxes(entry, 1, scene, 7).front().isApprox(boxes.front()));
  }
  EXPECT_EQ(sides.size(), 150u) << "every box is another one";
  EXPECT_EQ(draw_boxes(entry, 0, 0, 7).size(), 0u);
}

/// The same boxes as a scene, whose distances are other code.
Scene scene_of(const std::vector<StudyBox>& boxes) {
  std::vector<SceneObject> objects;
  for (const StudyBox& box : boxes) {
    Waypoint waypoint;
    waypoint.T_world_object.translation() = box.center();
    objects.push_back({"box", Box{box.sizes()}, {waypoint}, false});
  }
  return Scene(std::move(objects));
}

TEST(StudyScenes, FieldIsTheExactDistanceWithItsGradient) {
  StudyRobotEntry entry;
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-2.0, 2.0);
  for (int scene = 0; scene < 20; ++scene) {
    const auto boxes = draw_boxes(entry, 1 + scene % 4, scene, 3);
    const auto field = true_field(boxes);
    const Scene truth = scene_of(boxes);
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector3d p(uniform(random), uniform(random), uniform(random));
      double d = 0.0;
      Eigen::Vector3d gradient;
      FieldStatus status = FieldStatus::kUnknown;
      field->query({&p, 1}, {&d, 1}, {&gradient, 1}, {&status, 1});
      EXPECT_NEAR(d, truth.signed_distance(p, 0.0).distance_m, 1e-12);
      EXPECT_EQ(status, FieldStatus::kKnown);
      EXPECT_NEAR(gradient.norm(), 1.0, 1e-9);
      constexpr double kStep = 1e-7;
      EXPECT_NEAR(truth.signed_distance(p + kStep * gradient, 0.0).distance_m - d, kStep, 1e-9);
    }
  }
}

TEST(StudyScenes, MapHoldsTheVoxelsThatBoxesReach) {
  const GridSpec grid{{-1.03, -0.7, 0.0}, 0.1, {70, 17, 12}};
  BoxMap map(grid);
  StudyRobotEntry entry;
  std::int64_t occupied = 0;
  for (int scene = 0; scene < 10; ++scene) {
    const auto boxes = draw_boxes(entry, 2, scene, 11);
    const MapUpdate update = map.set_boxes(boxes);
    EXPECT_EQ(update.sequence, scene + 1);
    for (int z = 0; z < 12; ++z) {
      for (int y = 0; y < 17; ++y) {
        for (int x = 0; x < 70; ++x) {
          const Eigen::Vector3i voxel(x, y, z);
          const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.05);
          const StudyBox cube(grid.centre_m(voxel) - half, grid.centre_m(voxel) + half);
          const bool reached =
              std::ranges::any_of(boxes, [&](const StudyBox& box) { return box.intersects(cube); });
          ASSERT_EQ(map.occupied().at(grid, voxel), reached) << voxel.transpose();
          ASSERT_TRUE(map.known().at(grid, voxel));
          occupied += reached ? 1 : 0;
        }
      }
    }
  }
  EXPECT_GT(occupied, 100);
  EXPECT_FALSE(map.integrate({}));
}

/// Hands back the first guess: what comes of it is for the check to say.
class NoOptimiser final : public Optimiser {
 public:
  Result<Solution> solve(const Problem&, const Trajectory& initial, const Deadline&) override {
    Solution solution;
    solution.status = SolveStatus::kConverged;
    solution.trajectory = initial;
    return solution;
  }
};

PluginPtr<Optimiser> no_optimiser() {
  const auto destroy = [](void* object) { delete static_cast<NoOptimiser*>(object); };
  return {new NoOptimiser, PluginDeleter{destroy, "optimiser none"}};
}

/// Least distance of a ball's centre on a straight way to the boxes.
double nearest_m(const Scene& truth, const Eigen::VectorXd& from, const Eigen::VectorXd& to) {
  constexpr int kSamples = 1000;
  double least = 1e9;
  for (int i = 0; i <= kSamples; ++i) {
    const Eigen::Vector3d p = from + (to - from) * i / kSamples;
    least = std::min(least, truth.signed_distance(p, 0.0).distance_m);
  }
  return least;
}

class StudySolverTest : public testing::Test {
 protected:
  StudySolverTest() {
    study_.entry = flat_entry();
    study_.entry.support_states = 5;
    study_.entry.duration_s = 2.0;
    study_.grid = {{-3.0, -3.0, -3.0}, 0.5, {12, 12, 12}};
    std::vector<Error> errors;
    study_.entry.state_ranges =
        parse_yaml("{x: [-2, 2], y: [-1.5, 1.5], z: [0.3, 0.3]}", "ranges", errors).value();
    study_.planning.unknown = study_.planning.outside = "free";
  }

  StudyScene scene(int number, const std::vector<StudyBox>& boxes, bool free) const {
    const auto field = true_field(boxes);
    return {
        number,
        {field, field},
        make_field_check(ball_, field, {Space::kFree, Space::kOccupied}, {.obstacles_only = true}),
        std::vector<char>(kStates, free ? 1 : 0)};
  }

  static constexpr int kStates = 6;
  static constexpr double kRadius_m = 0.1;
  StudyRobot study_;
  std::shared_ptr<const RobotModel> ball_ =
      std::make_shared<const testing_support::BallRobot>(kRadius_m);
};

TEST_F(StudySolverTest, CallsCollisionFreeWhatKeepsClearOfTheTrueBoxes) {
  const auto states = draw_states(study_, ball_, kStates, 4);
  ASSERT_TRUE(states) << states.error().describe();
  StudySolver solver{study_, ball_, *states, no_optimiser(), false};
  int hits = 0, misses = 0;
  for (int number = 0; number < 30; ++number) {
    const auto boxes = draw_boxes(study_.entry, 2, number, 1);
    const Scene truth = scene_of(boxes);
    for (std::int64_t pair = 0; pair < kStates * (kStates - 1) / 2; ++pair) {
      const auto solved = solver.solve(scene(number, boxes, true), pair, Deadline());
      ASSERT_TRUE(solved) << solved.error().describe();
      EXPECT_EQ(solved->problem, number * 15 + pair);
      const auto [start, goal] = states_of_pair(pair, kStates);
      const double clearance_m = nearest_m(truth, (*states)[static_cast<std::size_t>(start)],
                                           (*states)[static_cast<std::size_t>(goal)]) -
                                 kRadius_m;
      if (std::abs(clearance_m) < 2e-3) continue;  // closer than the samples can tell
      for (const FieldOutcome& field : solved->fields) {
        EXPECT_TRUE(field.attempted);
        EXPECT_EQ(field.collision_free, clearance_m > 0.0) << clearance_m;
      }
      ++(clearance_m > 0.0 ? misses : hits);
    }
  }
  EXPECT_GT(hits, 50);
  EXPECT_GT(misses, 50);
}

TEST_F(StudySolverTest, SkipsProblemsThatStartInACollisionWhereAsked) {
  const auto states = draw_states(study_, ball_, kStates, 4);
  ASSERT_TRUE(states);
  const StudyScene blocked = scene(0, {}, false);
  StudySolver skipping{study_, ball_, *states, no_optimiser(), true};
  StudySolver solving{study_, ball_, *states, no_optimiser(), false};
  EXPECT_FALSE(skipping.solve(blocked, 0, Deadline())->fields[kSigned].attempted);
  EXPECT_TRUE(solving.solve(blocked, 0, Deadline())->fields[kSigned].attempted);
  EXPECT_FALSE(solving.solve(blocked, 0, Deadline())->start_free);
  EXPECT_TRUE(skipping.solve(scene(0, {}, true), 0, Deadline())->fields[kSigned].attempted);
}

TEST_F(StudySolverTest, AnInterruptedProblemHasNoOutcome) {
  const auto states = draw_states(study_, ball_, kStates, 4);
  ASSERT_TRUE(states);
  StudySolver solver{study_, ball_, *states, no_optimiser(), false};
  const auto solved = solver.solve(scene(0, {}, true), 0, Deadline::after_s(-1.0));
  ASSERT_FALSE(solved);
  EXPECT_EQ(solved.error().code, ErrorCode::kCancelled);
}

TEST_F(StudySolverTest, StatesLieInTheirRangesAndTheField) {
  const auto states = draw_states(study_, ball_, 40, 4);
  ASSERT_TRUE(states);
  for (const Eigen::VectorXd& q : *states) {
    EXPECT_LE(std::abs(q[0]), 2.0);
    EXPECT_LE(std::abs(q[1]), 1.5);
    EXPECT_EQ(q[2], 0.3);
  }
  EXPECT_EQ(draw_states(study_, ball_, 5, 4)->back(), (*states)[4]) << "whatever their number";
  study_.grid.origin_m.x() = 50.0;
  const auto nowhere = draw_states(study_, ball_, 2, 4);
  ASSERT_FALSE(nowhere);
  EXPECT_THAT(nowhere.error().describe(), HasSubstr("hardly any state of 'ball'"));
}

}  // namespace
}  // namespace sidestep
