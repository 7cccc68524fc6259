#include <sidestep/core/index.hpp>
#include <sidestep/problems/recorded_problems.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include <sidestep/field/dense_field.hpp>
#include <sidestep/measures/field_accuracy.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/initial_guess.hpp>

namespace sidestep {
namespace {

constexpr double kEmptyScene_m = 1000.0;
constexpr int kExactSteps = 20;  ///< An interval, between states that are checked exactly.
constexpr int kHeading = 2;      ///< Joint of a mobile base.

std::vector<std::uint8_t> occupied_nodes(const GridSpec& grid, const Eigen::Array3d& first_m,
                                         const std::vector<RecordedBox>& boxes) {
  std::vector<std::uint8_t> occupied(grid.voxel_count());
  const double cell_m = grid.resolution_m;
  std::size_t at = 0;
  for (int k = 0; k < grid.size_vox.z(); ++k) {
    for (int j = 0; j < grid.size_vox.y(); ++j) {
      for (int i = 0; i < grid.size_vox.x(); ++i) {
        const Eigen::Array3d node_m = first_m + cell_m * Eigen::Array3d(i, j, k);
        occupied[at++] = std::ranges::any_of(boxes, [&](const RecordedBox& box) {
          return (node_m > box.lower_m.array() - 0.5 * cell_m).all() &&
                 (node_m < box.upper_m.array() + 0.5 * cell_m).all();
        });
      }
    }
  }
  return occupied;
}

/// Calls visit(time_s) at `steps` + 1 times an interval, both ends included.
template <class Visit>
void each_time(const Trajectory& trajectory, int steps, Visit visit) {
  for (std::size_t i = 0; i + 1 < trajectory.times_s.size(); ++i) {
    const double begin_s = trajectory.times_s[i];
    const double dt_s = trajectory.times_s[i + 1] - begin_s;
    for (int k = 0; k < steps; ++k) visit(begin_s + k * dt_s / steps);
  }
  visit(trajectory.duration_s());
}

/// Exact signed distance to a box. On a plane, its height does not matter.
double distance_m(const RecordedBox& box, const Eigen::Vector3d& p, bool on_plane) {
  const Eigen::Vector3d centre = 0.5 * (box.lower_m + box.upper_m);
  Eigen::Vector3d beyond = (p - centre).cwiseAbs() - 0.5 * (box.upper_m - box.lower_m);
  if (on_plane) beyond.z() = -std::numeric_limits<double>::infinity();
  return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

/// Moves the base's positions from the straight line onto the screw motion between its ends, the
/// geodesic of SE(2): an arc, along which it turns evenly.
void put_base_on_arc(Trajectory& trajectory) {
  const auto first = trajectory.q(0), last = trajectory.q(trajectory.size() - 1);
  const std::complex<double> start_m(first[0], first[1]),
      way_m = {last[0] - first[0], last[1] - first[1]};
  const double turn = last[kHeading] - first[kHeading];
  if (turn == 0.0) return;
  const auto chord = [](double angle) { return std::polar(1.0, angle) - 1.0; };
  for (int i = 1; i + 1 < trajectory.size(); ++i) {
    const auto q = trajectory.q(i);
    const auto at_m = start_m + way_m * chord(q[kHeading] - first[kHeading]) / chord(turn);
    q[0] = at_m.real();
    q[1] = at_m.imag();
  }
}

/// An angle as poses of the peer have it, in [-pi, pi].
double in_half_turns(double angle_rad) { return std::remainder(angle_rad, 2.0 * std::numbers::pi); }

/// Turns the velocity of a base from its own frame into the world's.
void turn_into_world(std::span<const double> q, std::span<double> qdot) {
  const std::complex<double> in_world =
      std::polar(1.0, q[kHeading]) * std::complex<double>(qdot[0], qdot[1]);
  qdot[0] = in_world.real();
  qdot[1] = in_world.imag();
}

}  // namespace

std::shared_ptr<const DistanceField> recorded_field(const RecordedProblems& problems, int scene,
                                                    bool is_signed) {
  const GridSpec& grid = problems.grid;
  const auto occupied =
      occupied_nodes(grid, problems.first_node_m.array(), problems.scenes[idx(scene)]);
  const double diagonal_m = grid.resolution_m * grid.size_vox.cast<double>().norm();
  auto distances_m = exact_distances_m(grid, occupied, diagonal_m, is_signed);
  if (std::ranges::count(occupied, 0) == std::ssize(occupied)) {
    std::ranges::fill(distances_m, static_cast<float>(kEmptyScene_m));
  }
  const FieldInfo info{.grid = grid,
                       .is_signed = is_signed,
                       .max_distance_m = std::numeric_limits<double>::infinity(),
                       .lipschitz = 1.0};
  return make_dense_field(
      info, [&](const Eigen::Vector3i& voxel) { return distances_m[grid.linear(voxel)]; });
}

Problem recorded_problem(const RecordedProblems& problems,
                         std::shared_ptr<const DistanceField> field, int pair) {
  const RecordedSettings& settings = problems.settings;
  const auto [start, goal] = problems.pairs[idx(pair)];
  const auto at_rest = [&](int configuration) {
    const auto& q = problems.configurations[idx(configuration)];
    return RobotState{q, Eigen::VectorXd::Zero(q.size())};
  };
  Problem problem;
  problem.robot = problems.robot;
  problem.field = std::move(field);
  problem.space = {Space::kFree, Space::kFree};
  problem.start = at_rest(start);
  problem.goal = at_rest(goal);
  if (problems.has_base) {
    const double turn = problem.goal.q[kHeading] - problem.start.q[kHeading];
    problem.goal.q[kHeading] = problem.start.q[kHeading] + in_half_turns(turn);
  }
  problem.support_states = settings.support_states;
  problem.dt_s = settings.dt_s;
  problem.qc = Eigen::VectorXd::Constant(problem.start.q.size(), settings.qc);
  problem.interpolated_checks = settings.interpolated_checks;
  problem.terms = {
      {make_state_prior("start", problem.start, settings.sigma_endpoint), Placement::kStart},
      {make_state_prior("goal", problem.goal, settings.sigma_endpoint), Placement::kGoal},
      {make_obstacle_cost(problem.robot, problem.field, problem.space, settings.epsilon_m,
                          settings.sigma_obstacle_m),
       Placement::kSupportAndInterpolated}};
  return problem;
}

Trajectory recorded_initial(const RecordedProblems& problems, const Problem& problem) {
  Trajectory out = straight_line(problem);
  Eigen::VectorXd step = (problem.goal.q - problem.start.q) / (problem.support_states - 1);
  if (problems.has_base) {
    put_base_on_arc(out);
    step[kHeading] =
        (in_half_turns(problem.goal.q[kHeading]) - in_half_turns(problem.start.q[kHeading])) /
        (problem.support_states - 1);
  }
  for (int i = 0; i < out.size(); ++i) {
    std::ranges::copy(step, out.qdot(i).begin());
    if (problems.has_base) turn_into_world(out.q(i), out.qdot(i));
  }
  return out;
}

double clearance_at_checks_m(const Problem& problem, const DistanceField& field,
                             const Trajectory& trajectory) {
  const auto& spheres = problem.robot->description().spheres;
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof)), distances_m(spheres.size());
  std::vector<Eigen::Vector3d> centres_m(spheres.size());
  std::vector<FieldStatus> statuses(spheres.size());
  Scratch scratch;
  double least_m = std::numeric_limits<double>::infinity();
  each_time(trajectory, problem.interpolated_checks + 1, [&](double time_s) {
    trajectory.sample(time_s, q, {});
    problem.robot->sphere_centres(q, centres_m, scratch);
    query_with_policy(field, {Space::kFree, Space::kFree}, centres_m, distances_m, {}, statuses);
    for (std::size_t i = 0; i < spheres.size(); ++i) {
      least_m = std::min(least_m, distances_m[i] - spheres[i].radius_m);
    }
  });
  return least_m;
}

double exact_clearance_m(const RecordedProblems& problems, int scene, std::span<const double> q) {
  const auto& spheres = problems.robot->description().spheres;
  const bool on_plane = problems.grid.size_vox.z() == 1;
  std::vector<Eigen::Vector3d> centres_m(spheres.size());
  Scratch scratch;
  problems.robot->sphere_centres(q, centres_m, scratch);
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    for (const RecordedBox& box : problems.scenes[idx(scene)]) {
      least_m = std::min(least_m, distance_m(box, centres_m[i], on_plane) - spheres[i].radius_m);
    }
  }
  return least_m;
}

double exact_clearance_m(const RecordedProblems& problems, int scene,
                         const Trajectory& trajectory) {
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof));
  double least_m = std::numeric_limits<double>::infinity();
  each_time(trajectory, kExactSteps, [&](double time_s) {
    trajectory.sample(time_s, q, {});
    least_m = std::min(least_m, exact_clearance_m(problems, scene, std::span<const double>(q)));
  });
  return least_m;
}

}  // namespace sidestep
