// Against GPMP2 itself: problems that it has solved, with its costs term by term.
#include <fstream>
#include <numeric>

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <sidestep/problems/recorded_problems.hpp>

#include "factors.hpp"
#include "gp_ceres.hpp"

namespace sidestep {
namespace {

double sum_of_squares(const StateCost& cost, const Trajectory& trajectory,
                      const std::vector<double>& times_s) {
  const auto dof = static_cast<std::size_t>(trajectory.dof);
  std::vector<double> q(times_s.size() * dof), qdot(q.size());
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    trajectory.sample(times_s[i], std::span(q).subspan(i * dof, dof),
                      std::span(qdot).subspan(i * dof, dof));
  }
  std::vector<double> residuals(times_s.size() * static_cast<std::size_t>(cost.residual_count()));
  Scratch scratch;
  cost.evaluate({static_cast<int>(times_s.size()), trajectory.dof, q, qdot, times_s},
                {residuals, {}, {}}, scratch);
  return std::inner_product(residuals.begin(), residuals.end(), residuals.begin(), 0.0);
}

double prior_sum_of_squares(const GpPrior& prior, const Trajectory& trajectory) {
  const GpPriorFactor factor(prior);
  const auto state = [&](int i) {
    std::vector<double> x(trajectory.q(i).begin(), trajectory.q(i).end());
    x.insert(x.end(), trajectory.qdot(i).begin(), trajectory.qdot(i).end());
    return x;
  };
  double sum = 0.0;
  for (int i = 0; i + 1 < trajectory.size(); ++i) {
    const std::vector<double> a = state(i), b = state(i + 1);
    const double* const states[] = {a.data(), b.data()};
    Eigen::VectorXd residuals(factor.num_residuals());
    factor.Evaluate(states, residuals.data(), nullptr);
    sum += residuals.squaredNorm();
  }
  return sum;
}

/// Each term of a trajectory's cost as GPMP2 groups them.
void expect_costs(const Problem& problem, const Trajectory& trajectory,
                  const nlohmann::json& expected) {
  const auto near = [](double actual, double recorded, const char* term) {
    // Fields are stored in single precision.
    EXPECT_NEAR(actual, recorded, 1e-6 * (1.0 + recorded)) << term;
  };
  const double end_s = trajectory.duration_s();
  std::vector<double> between_s;
  for (int i = 0; i + 1 < trajectory.size(); ++i) {
    for (int k = 1; k <= problem.interpolated_checks; ++k) {
      between_s.push_back((i + k / (problem.interpolated_checks + 1.0)) * problem.dt_s);
    }
  }
  const StateCost& obstacle = *problem.terms[2].cost;
  near(0.5 * prior_sum_of_squares(GpPrior(problem.qc, problem.dt_s), trajectory),
       expected["gp_prior"], "GP prior");
  near(0.5 * sum_of_squares(obstacle, trajectory, trajectory.times_s), expected["obstacle_unary"],
       "obstacles at support states");
  near(0.5 * sum_of_squares(obstacle, trajectory, between_s), expected["obstacle_gp"],
       "obstacles at interpolated states");
  near(0.5 * (sum_of_squares(*problem.terms[0].cost, trajectory, {0.0}) +
              sum_of_squares(*problem.terms[1].cost, trajectory, {end_s})),
       expected["start_goal_priors"], "start and goal");
}

Trajectory recorded(const nlohmann::json& values, double dt_s) {
  Trajectory out = make_trajectory(static_cast<int>(values["x"][0].size()),
                                   static_cast<int>(values["x"].size()), dt_s);
  for (int i = 0; i < out.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const auto q = values["x"][at].get<std::vector<double>>();
    const auto qdot = values["v"][at].get<std::vector<double>>();
    std::ranges::copy(q, out.q(i).begin());
    std::ranges::copy(qdot, out.qdot(i).begin());
  }
  return out;
}

class Gpmp2Test : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(folder_ / "anchors.json")) {
      GTEST_SKIP() << "no recorded problems in " << folder_;
    }
    auto problems = read_recorded_problems(folder_ / ("problems_" + GetParam() + ".json"));
    ASSERT_TRUE(problems) << problems.error().describe();
    problems_ = std::move(*problems);
  }

  [[nodiscard]] nlohmann::json anchors() const {
    std::ifstream stream(folder_ / "anchors.json");
    return nlohmann::json::parse(stream).at(GetParam());
  }

  const std::filesystem::path folder_ = std::filesystem::path(SIDESTEP_SHARED_DATA) / "gpmp2";
  RecordedProblems problems_;
};

TEST_P(Gpmp2Test, PosesTheSameProblem) {
  for (const auto& anchor : anchors()) {
    const int scene = anchor["scene"], pair = anchor["pair"];
    SCOPED_TRACE("scene " + std::to_string(scene) + ", pair " + std::to_string(pair));
    const Problem problem =
        recorded_problem(problems_, recorded_field(problems_, scene, true), pair);

    const auto& recorded_spheres = anchor["start_sphere_centres_xyz_sdf"];
    std::vector<Eigen::Vector3d> centres(problem.robot->description().spheres.size());
    std::vector<double> distances(centres.size());
    ASSERT_EQ(recorded_spheres.size(), centres.size());
    Scratch scratch;
    problem.robot->sphere_centres({problem.start.q.data(), 7}, centres, scratch);
    problem.field->query(centres, distances, {}, {});
    for (std::size_t s = 0; s < centres.size(); ++s) {
      const auto sphere = recorded_spheres[s].get<std::vector<double>>();
      EXPECT_LT((centres[s] - Eigen::Vector3d(sphere[0], sphere[1], sphere[2])).norm(), 1e-9)
          << "sphere " << s;
      EXPECT_NEAR(distances[s], sphere[3], 1e-6) << "sphere " << s;
    }

    const Trajectory initial = recorded(anchor["initial_values"], problem.dt_s);
    const Trajectory ours = recorded_initial(problems_, problem);
    for (std::size_t i = 0; i < ours.positions.size(); ++i) {
      EXPECT_NEAR(ours.positions[i], initial.positions[i], 1e-12);
      EXPECT_NEAR(ours.velocities[i], initial.velocities[i], 1e-12);
    }
    expect_costs(problem, initial, anchor["initial"]);
    expect_costs(problem, recorded(anchor["final_values"], problem.dt_s), anchor["final"]);
  }
}

double median(std::vector<double> values) {
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
  return values[values.size() / 2];
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// Over all pairs and scenes, with GPMP2's stopping rules: the damping differs, so that
/// single problems end in other minima, but not the lot.
TEST_P(Gpmp2Test, FindsCostsAsLowOverAll) {
  const RecordedRun& run = problems_.runs.front();
  ASSERT_EQ(run.label, "study");
  ASSERT_TRUE(run.is_signed);
  std::vector<std::shared_ptr<const DistanceField>> fields;
  for (std::size_t scene = 0; scene < problems_.scenes.size(); ++scene) {
    fields.push_back(recorded_field(problems_, static_cast<int>(scene), true));
  }
  const auto optimiser = make_gp_ceres({});
  std::vector<double> ours, theirs;
  for (const RecordedOutcome& peer : run.outcomes) {
    const Problem problem =
        recorded_problem(problems_, fields[static_cast<std::size_t>(peer.scene)], peer.pair);
    const auto solution =
        optimiser->solve(problem, recorded_initial(problems_, problem), Deadline());
    ASSERT_TRUE(solution.has_value()) << solution.error().describe();
    EXPECT_NEAR(solution->initial_cost, peer.initial_cost, 1e-6 * peer.initial_cost);
    ours.push_back(solution->cost);
    theirs.push_back(peer.final_cost);
  }
  ASSERT_EQ(ours.size(), problems_.pairs.size() * fields.size());
  EXPECT_LE(mean(ours), 1.02 * mean(theirs));
  EXPECT_LE(median(ours), 1.02 * median(theirs));
  RecordProperty("mean_ratio", std::to_string(mean(ours) / mean(theirs)));
  RecordProperty("median_ratio", std::to_string(median(ours) / median(theirs)));
}

INSTANTIATE_TEST_SUITE_P(Recorded, Gpmp2Test,
                         testing::Values("panda_single", "panda_clutter", "wam_single",
                                         "wam_clutter"),
                         [](const auto& of) { return of.param; });

}  // namespace
}  // namespace sidestep
