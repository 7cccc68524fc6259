#include <sidestep/problems/recorded_problems.hpp>

#include <cmath>
#include <fstream>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>

#include "support/recorded_file.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::json;
using testing::HasSubstr;
using testing_support::recorded_disc;
using testing_support::TemporaryFolder;

constexpr double kPi = std::numbers::pi;

Result<RecordedProblems> read(const Json& json) {
  const TemporaryFolder folder;
  return read_recorded_problems(folder.write("problems.json", json.dump()));
}

Eigen::Vector3d only_sphere(const RecordedProblems& problems, const std::vector<double>& q) {
  std::vector<Eigen::Vector3d> centres(1);
  Scratch scratch;
  problems.robot->sphere_centres(q, centres, scratch);
  return centres[0];
}

/// The disc's file with another robot, whose only pair of configurations is from q to q.
Json with_robot(const Json& robot, const std::vector<double>& q) {
  Json json = recorded_disc();
  json["robot"] = robot;
  json["configurations"] = {q, q};
  json["pairs"] = {{0, 1}};
  json["runs"] = Json::array();
  return json;
}

TEST(RecordedProblems, ReadsWhatIsWritten) {
  const auto problems = read(recorded_disc());
  ASSERT_TRUE(problems) << problems.error().describe();
  EXPECT_FALSE(problems->has_base);
  EXPECT_EQ(problems->robot->description().dof(), 2);
  EXPECT_EQ(problems->scenes.size(), 2u);
  EXPECT_EQ(problems->grid.size_vox, Eigen::Vector3i(61, 41, 1));
  EXPECT_LT((problems->grid.centre_m(Eigen::Vector3i(0, 0, 0)) - Eigen::Vector3d(-3, -2, 0)).norm(),
            1e-12);
  EXPECT_DOUBLE_EQ(problems->settings.dt_s, 1.0);
  ASSERT_EQ(problems->runs.size(), 2u);
  EXPECT_EQ(problems->runs[1].label, "replan");
  EXPECT_FALSE(problems->runs[1].is_signed);
  EXPECT_EQ(problems->runs[1].max_iterations, 1);
  const RecordedOutcome& last = problems->runs[0].outcomes.back();
  EXPECT_EQ(last.scene, 1);
  EXPECT_EQ(last.pair, 2);
  EXPECT_DOUBLE_EQ(last.final_cost, 0.0432);
  EXPECT_DOUBLE_EQ(last.total_ms, 2.0);
  EXPECT_DOUBLE_EQ(last.optimise_ms, 1.5);
}

TEST(RecordedProblems, PosesAPair) {
  const auto problems = read(recorded_disc());
  ASSERT_TRUE(problems) << problems.error().describe();
  const Problem problem = recorded_problem(*problems, recorded_field(*problems, 1, true), 0);
  ASSERT_TRUE(problem.validate()) << problem.validate().error().describe();
  EXPECT_EQ(problem.support_states, 6);
  EXPECT_EQ(problem.interpolated_checks, 3);
  EXPECT_EQ(problem.start.q, Eigen::Vector2d(-1, 0));
  EXPECT_EQ(problem.goal.q, Eigen::Vector2d(1, 0));
  const Trajectory initial = recorded_initial(*problems, problem);
  for (int i = 0; i < initial.size(); ++i) {
    EXPECT_NEAR(initial.q(i)[0], -1.0 + 0.4 * i, 1e-12);
    EXPECT_NEAR(initial.qdot(i)[0], 0.4, 1e-12) << "per interval, the ends included";
  }
}

TEST(RecordedProblems, OutsideTheFieldIsFree) {
  const auto problems = read(recorded_disc());
  ASSERT_TRUE(problems) << problems.error().describe();
  const Problem problem = recorded_problem(*problems, recorded_field(*problems, 1, true), 0);
  const std::vector<Eigen::Vector3d> points = {{0.0, 0.0, 0.0}, {0.0, 5.0, 0.0}};
  std::vector<double> distances(2);
  std::vector<FieldStatus> statuses(2);
  query_with_policy(*problem.field, problem.space, points, distances, {}, statuses);
  EXPECT_LT(distances[0], 0.0);
  EXPECT_EQ(distances[1], INFINITY);
}

/// Node by node, by the definition.
double brute_distance(const std::vector<Eigen::Vector3d>& nodes, const std::vector<bool>& wanted,
                      const Eigen::Vector3d& from) {
  double least = INFINITY;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (wanted[i]) least = std::min(least, (nodes[i] - from).norm());
  }
  return least;
}

TEST(RecordedProblems, FieldsAreExactBetweenNodes) {
  Json json = recorded_disc();
  json["grid"] = {{"cell", 0.25}, {"n", {9, 7, 5}}, {"origin", {-1.0, -0.75, 0.5}}};
  // The first box ends half a cell before nodes, which are thus not occupied; the second holds
  // none.
  json["scenes"] = {{{{"lo", {-0.375, -0.1, 0.6}}, {"hi", {0.375, 0.3, 1.0}}},
                     {{"lo", {0.8, 0.55, 1.3}}, {"hi", {0.85, 0.6, 1.35}}}}};
  json["runs"] = Json::array();
  const auto problems = read(json);
  ASSERT_TRUE(problems) << problems.error().describe();
  std::vector<Eigen::Vector3d> nodes;
  std::vector<bool> occupied, free;
  for (int i = 0; i < 9 * 7 * 5; ++i) {
    const Eigen::Vector3d node(-1.0 + 0.25 * (i % 9), -0.75 + 0.25 * (i / 9 % 7),
                               0.5 + 0.25 * (i / 63));
    bool is_occupied = false;
    for (const RecordedBox& box : problems->scenes[0]) {
      bool inside = true;
      for (int axis = 0; axis < 3; ++axis) {
        inside = inside && node[axis] > box.lower_m[axis] - 0.125 &&
                 node[axis] < box.upper_m[axis] + 0.125;
      }
      is_occupied = is_occupied || inside;
    }
    nodes.push_back(node);
    occupied.push_back(is_occupied);
    free.push_back(!is_occupied);
  }
  ASSERT_GT(std::count(occupied.begin(), occupied.end(), true), 10);
  EXPECT_FALSE(occupied[9 * 3 + 2]) << "x = -0.5 is 0.125 from the box, and not less";
  for (const bool is_signed : {false, true}) {
    const auto field = recorded_field(*problems, 0, is_signed);
    std::vector<double> distances(nodes.size());
    field->query(nodes, distances, {}, {});
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const double inside = is_signed ? brute_distance(nodes, free, nodes[i]) : 0.0;
      EXPECT_NEAR(distances[i], brute_distance(nodes, occupied, nodes[i]) - inside, 1e-6) << i;
    }
  }
}

TEST(RecordedProblems, AnEmptySceneIsFarAway) {
  const auto problems = read(recorded_disc());
  ASSERT_TRUE(problems) << problems.error().describe();
  std::vector<double> distance(1);
  recorded_field(*problems, 0, true)
      ->query(std::vector{Eigen::Vector3d(0, 0, 0)}, distance, {}, {});
  EXPECT_EQ(distance[0], 1000.0);
  const Problem problem = recorded_problem(*problems, recorded_field(*problems, 0, true), 0);
  EXPECT_EQ(exact_clearance_m(*problems, 0, recorded_initial(*problems, problem)), INFINITY);
}

TEST(RecordedProblems, ClearancesAreThoseOfStraightMotions) {
  const auto problems = read(recorded_disc());
  ASSERT_TRUE(problems) << problems.error().describe();
  const auto field = recorded_field(*problems, 1, true);
  const auto straight = [&](int pair) {
    const Problem problem = recorded_problem(*problems, field, pair);
    return std::pair(problem, straight_line(problem.start, problem.goal, 6, 1.0));
  };
  // Past the square at y = 1: 0.8 m from its edge, the nearest node of the field is at that edge.
  const auto [past, along] = straight(1);
  EXPECT_NEAR(exact_clearance_m(*problems, 1, along), 0.8 - 0.1, 1e-12);
  EXPECT_NEAR(clearance_at_checks_m(past, *field, along), 0.8 - 0.1, 1e-6);
  // Through its middle, where 0.2 m are missing to get out.
  const auto [through, across] = straight(0);
  EXPECT_NEAR(exact_clearance_m(*problems, 1, across), -0.2 - 0.1, 1e-3);
  EXPECT_LT(clearance_at_checks_m(through, *field, across), -0.2);
  const std::vector<double> beside = {0.5, 0.6};
  EXPECT_NEAR(exact_clearance_m(*problems, 1, std::span<const double>(beside)), 0.5 - 0.1, 1e-12);
}

TEST(RecordedProblems, ReadsArmsInBothConventions) {
  const double l1 = 0.7, l2 = 0.4, q1 = 0.3, q2 = -1.1, bias = 0.2;
  const Eigen::Vector3d tip(l1 * std::cos(q1 + bias) + l2 * std::cos(q1 + bias + q2),
                            l1 * std::sin(q1 + bias) + l2 * std::sin(q1 + bias + q2), 0.15);
  const Json modified = {{"name", "arm"},
                         {"dh", "modified (Craig)"},
                         {"a", {0.0, l1}},
                         {"alpha", {0.0, 0.0}},
                         {"d", {0.15, 0.0}},
                         {"theta_bias", {bias, 0.0}},
                         {"spheres", {{1, l2, 0.0, 0.0, 0.05}}}};
  const Json classical = {{"name", "arm"},
                          {"dh", "classical (Spong)"},
                          {"a", {l1, l2}},
                          {"alpha", {0.0, 0.0}},
                          {"d", {0.15, 0.0}},
                          {"theta_bias", {bias, 0.0}},
                          {"spheres", {{1, 0.0, 0.0, 0.0, 0.05}}}};
  for (const Json& robot : {modified, classical}) {
    const auto problems = read(with_robot(robot, {q1, q2}));
    ASSERT_TRUE(problems) << problems.error().describe();
    EXPECT_LT((only_sphere(*problems, {q1, q2}) - tip).norm(), 1e-12) << robot.at("dh");
  }
}

TEST(RecordedProblems, ClassicalTwistsComeAfterTheJoint) {
  // A quarter's twist between two joints: the second one swings in the plane of its parent's x and
  // z.
  const Json robot = {{"name", "arm"},   {"dh", "classical"},
                      {"a", {0.5, 0.3}}, {"alpha", {kPi / 2, 0.0}},
                      {"d", {0.1, 0.0}}, {"spheres", {{1, 0, 0, 0, 0.05}}}};
  const double q1 = 0.6, q2 = 0.9, reach = 0.5 + 0.3 * std::cos(q2);
  const auto problems = read(with_robot(robot, {q1, q2}));
  ASSERT_TRUE(problems) << problems.error().describe();
  const Eigen::Vector3d tip(reach * std::cos(q1), reach * std::sin(q1), 0.1 + 0.3 * std::sin(q2));
  EXPECT_LT((only_sphere(*problems, {q1, q2}) - tip).norm(), 1e-12);
}

TEST(RecordedProblems, ReadsAnArmOnALiftOnABase) {
  Json robot = {{"name", "mobile"},
                {"dh", "modified"},
                {"a", {0.0}},
                {"alpha", {kPi / 2}},
                {"d", {0.0}},
                {"base_T_torso", {0.0, 0.0, 0.3}},
                {"torso_T_arm", {0.1, 0.0, 0.0}},
                {"spheres", {{2, 0.5, 0.0, 0.0, 0.05}}}};
  const std::vector<double> q = {1.0, -2.0, 3.0, 0.25, 0.4};
  Json json = with_robot(robot, q);
  json["configurations"][1] = {0.0, 0.0, -3.0, 0.0, 0.0};
  const auto problems = read(json);
  ASSERT_TRUE(problems) << problems.error().describe();
  EXPECT_TRUE(problems->has_base);
  const double reach = 0.1 + 0.5 * std::cos(0.4);
  const Eigen::Vector3d hand(1.0 + reach * std::cos(3.0), -2.0 + reach * std::sin(3.0),
                             0.3 + 0.25 + 0.5 * std::sin(0.4));
  EXPECT_LT((only_sphere(*problems, q) - hand).norm(), 1e-12);
  const Problem problem = recorded_problem(*problems, recorded_field(*problems, 0, true), 0);
  EXPECT_NEAR(problem.goal.q[2], 2 * kPi - 3.0, 1e-12) << "the shorter way round";

  json["robot"]["spheres"] = {{0, 0.2, 0.0, 0.1, 0.05}};
  const auto on_base = read(json);
  ASSERT_TRUE(on_base) << on_base.error().describe();
  EXPECT_LT((only_sphere(*on_base, q) -
             Eigen::Vector3d(1.0 + 0.2 * std::cos(3.0), -2.0 + 0.2 * std::sin(3.0), 0.1))
                .norm(),
            1e-12);
}

TEST(RecordedProblems, ABaseSetsOutAlongAnArc) {
  Json json = with_robot({{"name", "mobile"},
                          {"dh", "modified"},
                          {"a", {0.0}},
                          {"alpha", {0.0}},
                          {"d", {0.0}},
                          {"base_T_torso", {0.0, 0.0, 0.3}},
                          {"torso_T_arm", {0.1, 0.0, 0.0}},
                          {"spheres", {{0, 0.0, 0.0, 0.1, 0.05}}}},
                         {0.0, 0.0, 0.0, 0.0, 0.0});
  json["configurations"] = {
      {0.0, 0.0, 0.0, 0.0, 0.0}, {1.0, 1.0, kPi / 2, 0.2, 0.4}, {3.0, -1.0, 0.0, 0.0, 0.0}};
  json["pairs"] = {{0, 1}, {0, 2}};
  const auto problems = read(json);
  ASSERT_TRUE(problems) << problems.error().describe();
  const auto initial_of = [&](int pair) {
    return recorded_initial(*problems,
                            recorded_problem(*problems, recorded_field(*problems, 0, true), pair));
  };
  const Trajectory turning = initial_of(0), straight = initial_of(1);
  for (int i = 0; i < turning.size(); ++i) {
    const double share = i / (turning.size() - 1.0), heading = share * kPi / 2;
    const Eigen::VectorXd on_circle = Eigen::Vector<double, 5>(
        std::sin(heading), 1.0 - std::cos(heading), heading, 0.2 * share, 0.4 * share);
    const Eigen::VectorXd on_line = Eigen::Vector<double, 5>(3.0 * share, -share, 0.0, 0.0, 0.0);
    for (int joint = 0; joint < 5; ++joint) {
      EXPECT_NEAR(turning.q(i)[joint], on_circle[joint], 1e-12) << i << ", joint " << joint;
      EXPECT_NEAR(straight.q(i)[joint], on_line[joint], 1e-12) << i << ", joint " << joint;
    }
  }
}

struct Mistake {
  const char* pointer;  ///< What is replaced; an empty value: removed.
  Json value;
  const char* message;
};

TEST(RecordedProblems, NamesFileAndEntryOfAMistake) {
  const Json row = {0, 0, 3, 1e6, 0.192, 1, 1, 2000.0, 1500.0};
  Json short_row = row, odd_scene = row, odd_flag = row;
  short_row.erase(8);
  odd_scene[0] = 2;
  odd_flag[6] = 2;
  const Mistake mistakes[] = {
      {"/robot", nullptr, "problems.json: there is no `robot`"},
      {"/robot/spheres/0", {0, 0.0, 0.0}, "robot.spheres[0]: expected an array of 5 numbers"},
      {"/robot/spheres/0/0", 1,
       "robot.spheres[0][0]: expected a whole number from 0 to 0, found 1"},
      {"/robot/spheres/0/4", 0.0, "robot.spheres[0][4]: expected a number above 0, found 0.0"},
      {"/robot/dh", "odd", "robot.dh: the convention must begin with"},
      {"/robot/d_h", "modified", "robot: unknown key `d_h`"},
      {"/robot",
       {{"name", "arm"}, {"dh", "modified"}, {"base_pose", "tilted"}},
       "robot.base_pose: only \"identity\" is supported"},
      {"/grid/turn", 0.1, "problems.json: grid: unknown key `turn`"},
      {"/scenes/1/0/rpy", {0.0, 0.0, 0.1}, "scenes[1][0]: unknown key `rpy`"},
      {"/settings/epsilom", 0.3, "settings: unknown key `epsilom`: did you mean 'epsilon'?"},
      {"/runs/1/limit", 3, "runs[1]: unknown key `limit`"},
      {"/sceens", Json::array(), "unknown key `sceens`: did you mean 'scenes'?"},
      {"/grid/cell", "wide", "grid.cell: expected a number, found \"wide\""},
      {"/grid/n/1", 0, "grid.n[1]: expected a whole number from 1 to"},
      {"/grid/n", {10000, 10000, 10000}, "grid.n: the grid has more than"},
      {"/grid/origin",
       {0.0, 0.0},
       "grid.origin: expected an array of 3 numbers, found an array of 2"},
      {"/scenes", 3, "problems.json: scenes: expected an array, found 3"},
      {"/scenes/1/0/lo/0", 5.0, "scenes[1][0]: `lo` lies above `hi`"},
      {"/configurations", Json::array(), "configurations: there are 0 values, and no number 1"},
      {"/configurations/2", {1.0}, "configurations[2]: expected an array of 2 numbers"},
      {"/configurations/2/1", nullptr, "configurations[2]: expected an array of 2 numbers"},
      {"/pairs/1/1", 4, "pairs[1][1]: expected a whole number from 0 to 3, found 4"},
      {"/pairs/1", {1}, "pairs[1]: expected an array of 2 numbers"},
      {"/settings/states", 7, "settings.states: there is one state more than `total_step`"},
      {"/settings/states", 5.5, "settings.states: expected a whole number from 3"},
      {"/settings/cost_sigma", nullptr, "problems.json: settings: there is no `cost_sigma`"},
      {"/settings/vel_prior_sigma", 1.0, "settings.vel_prior_sigma: only as large as"},
      {"/settings/goal_vel", 1, "settings.goal_vel: only motions from rest to rest"},
      {"/result_columns/4", "price", "result_columns: there is no column `final_cost`"},
      {"/runs/1/field", "esdf", "runs[1].field: expected \"sdf\" or \"usdf\", found \"esdf\""},
      {"/runs/1/rel_tol", 1.5, "runs[1].rel_tol: expected a number from 0 to 1"},
      {"/runs/1/max_iter", 0, "runs[1].max_iter: expected a whole number from 1"},
      {"/runs/0/results/4", short_row,
       "runs[0].results[4]: there are 8 values, but `result_columns`"},
      {"/runs/0/results/4", odd_scene,
       "runs[0].results[4][0]: expected a whole number from 0 to 1"},
      {"/runs/0/results/4", odd_flag, "runs[0].results[4][6]: expected a whole number from 0 to 1"},
      {"/runs/0/results/4/4", "dear", "runs[0].results[4][4]: expected a number, found \"dear\""},
  };
  for (const Mistake& mistake : mistakes) {
    SCOPED_TRACE(mistake.pointer);
    Json json = recorded_disc();
    const Json::json_pointer at(mistake.pointer);
    if (!mistake.value.is_null()) {
      json[at] = mistake.value;
    } else if (json[at.parent_pointer()].is_object()) {
      json[at.parent_pointer()].erase(at.back());
    } else {
      json[at.parent_pointer()].erase(std::stoul(at.back()));
    }
    const auto problems = read(json);
    ASSERT_FALSE(problems);
    EXPECT_EQ(problems.error().code, ErrorCode::kConfig);
    EXPECT_THAT(problems.error().describe(), HasSubstr("problems.json: "));
    EXPECT_THAT(problems.error().describe(), HasSubstr(mistake.message));
  }
}

TEST(RecordedProblems, NamesTheLineWhereAFileIsNoJson) {
  const TemporaryFolder folder;
  const auto file = folder.write("broken.json", "{\n  \"robot\": 1,\n  \"grid\" 2\n}\n");
  const auto problems = read_recorded_problems(file);
  ASSERT_FALSE(problems);
  EXPECT_EQ(problems.error().code, ErrorCode::kConfig);
  EXPECT_THAT(problems.error().where, HasSubstr("broken.json:3:10"));
  const auto absent = read_recorded_problems(folder.path() / "absent.json");
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(read_recorded_problems(folder.path())) << "a folder";
  EXPECT_FALSE(read_recorded_problems(folder.write("empty.json", "")));
  EXPECT_FALSE(read_recorded_problems(folder.write("list.json", "[]")));
}

/// The recordings themselves, where they are at hand.
class RecordedByGpmp2 : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    const auto file = folder_ / ("problems_" + GetParam() + ".json");
    if (!std::filesystem::exists(file)) GTEST_SKIP() << "no recorded problems in " << file;
    auto problems = read_recorded_problems(file);
    ASSERT_TRUE(problems) << problems.error().describe();
    problems_ = std::move(*problems);
    json_ = json_of(file);
  }
  static Json json_of(const std::filesystem::path& file) {
    std::ifstream stream(file);
    return Json::parse(stream);
  }
  [[nodiscard]] std::size_t column(const std::string& name) const {
    const auto& names = json_.at("result_columns");
    return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  }

  const std::filesystem::path folder_ = std::filesystem::path(SIDESTEP_SHARED_DATA) / "gpmp2";
  RecordedProblems problems_;
  Json json_;
};

TEST_P(RecordedByGpmp2, AgreesOnWhichEndsAreFree) {
  const auto is_free = [&](int scene, int configuration) {
    const auto& q = problems_.configurations[static_cast<std::size_t>(configuration)];
    return exact_clearance_m(problems_, scene, {q.data(), static_cast<std::size_t>(q.size())}) >
           0.0;
  };
  const auto& rows = json_.at("runs").at(0).at("results");
  int free = 0;
  ASSERT_EQ(rows.size(), problems_.runs.at(0).outcomes.size());
  for (const Json& row : rows) {
    const auto& pair = problems_.pairs.at(row.at(1).get<std::size_t>());
    EXPECT_EQ(is_free(row.at(0), pair.first), row.at(column("start_free_exact")) == 1) << row;
    EXPECT_EQ(is_free(row.at(0), pair.second), row.at(column("goal_free_exact")) == 1) << row;
    free += is_free(row.at(0), pair.first) ? 1 : 0;
  }
  EXPECT_GT(free, 100);
}

class ArmsRecordedByGpmp2 : public RecordedByGpmp2 {};

TEST_P(ArmsRecordedByGpmp2, AgreesOnTheClearanceOfItsTrajectories) {
  const Json anchors = json_of(folder_ / "anchors.json");
  for (const Json& anchor : anchors.at(GetParam())) {
    const auto& x = anchor.at("final_values").at("x");
    const auto& v = anchor.at("final_values").at("v");
    Trajectory trajectory = make_trajectory(7, static_cast<int>(x.size()), problems_.settings.dt_s);
    for (int i = 0; i < trajectory.size(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      std::ranges::copy(x.at(at).get<std::vector<double>>(), trajectory.q(i).begin());
      std::ranges::copy(v.at(at).get<std::vector<double>>(), trajectory.qdot(i).begin());
    }
    for (const Json& row : json_.at("runs").at(0).at("results")) {
      if (row.at(0) != anchor.at("scene") || row.at(1) != anchor.at("pair")) continue;
      EXPECT_NEAR(exact_clearance_m(problems_, row.at(0), trajectory),
                  row.at(column("min_clearance_exact_dense_m")).get<double>(), 6e-6);
      const Problem problem =
          recorded_problem(problems_, recorded_field(problems_, row.at(0), true), row.at(1));
      EXPECT_NEAR(clearance_at_checks_m(problem, *problem.field, trajectory),
                  row.at(column("min_clearance_sdf_checked_m")).get<double>(), 6e-6);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Files, RecordedByGpmp2,
                         testing::Values("panda_single", "wam_clutter", "hsr_single", "hsr_clutter",
                                         "point2d_single"),
                         [](const auto& of) { return of.param; });
INSTANTIATE_TEST_SUITE_P(Files, ArmsRecordedByGpmp2,
                         testing::Values("panda_single", "panda_clutter", "wam_single",
                                         "wam_clutter"),
                         [](const auto& of) { return of.param; });

}  // namespace
}  // namespace sidestep
