#include "study_parts.hpp"

#include <algorithm>
#include <random>

#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/runtime/call_plugin.hpp>

namespace sidestep {
namespace {

constexpr int kDrawsPerState = 10000;
constexpr double kFar_m = 1000.0;

/// The same on every platform, which std::uniform_real_distribution is not.
double uniform(std::mt19937_64& random, double lower, double upper) {
  constexpr double kUnit = 1.0 / 9007199254740992.0;  // 2^-53
  return lower + (upper - lower) * (static_cast<double>(random() >> 11) * kUnit);
}

Eigen::Vector3d uniform(std::mt19937_64& random, const Eigen::Vector3d& lower,
                        const Eigen::Vector3d& upper) {
  Eigen::Vector3d value;
  for (int axis = 0; axis < 3; ++axis) value[axis] = uniform(random, lower[axis], upper[axis]);
  return value;
}

Error cancelled() {
  return Error{ErrorCode::kCancelled, "the study was interrupted", {}, {}, nullptr};
}

}  // namespace

std::vector<StudyBox> draw_boxes(const StudyRobotEntry& robot, int boxes, int scene,
                                 std::uint64_t seed) {
  std::mt19937_64 random(derive_seed(seed, "scene/" + robot.name + "/" + std::to_string(scene)));
  std::vector<StudyBox> drawn;
  for (int b = 0; b < boxes; ++b) {
    const Eigen::Vector3d half = 0.5 * uniform(random, robot.side_lower_m, robot.side_upper_m);
    const Eigen::Vector3d centre = uniform(random, robot.box_lower_m, robot.box_upper_m);
    drawn.emplace_back(centre - half, centre + half);
  }
  return drawn;
}

double mean_side_m(const StudyRobotEntry& robot, std::span<const StudyBox> boxes) {
  double sum_m = 0.0;
  int sides = 0;
  for (const StudyBox& box : boxes) {
    for (int axis = 0; axis < 3; ++axis) {
      if (robot.side_lower_m[axis] == robot.side_upper_m[axis]) continue;
      sum_m += box.sizes()[axis];
      ++sides;
    }
  }
  return sides > 0 ? sum_m / sides : 0.0;
}

Result<std::vector<Eigen::VectorXd>> draw_states(const StudyRobot& study,
                                                 const std::shared_ptr<const RobotModel>& robot,
                                                 int count, std::uint64_t seed) {
  std::vector<Error> errors;
  const RobotDescription& description = robot->description();
  const std::vector<JointRange> ranges = read_state_ranges(study.entry, description, errors);
  if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
  std::mt19937_64 random(derive_seed(seed, "states/" + study.entry.name));
  const auto nothing = true_field({});
  const StudyBox grid(study.grid.origin_m, study.grid.upper_m());
  std::vector<Eigen::Vector3d> centres(description.spheres.size());
  Scratch scratch;
  std::vector<Eigen::VectorXd> states;
  for (int draw = 0; static_cast<int>(states.size()) < count; ++draw) {
    if (draw == kDrawsPerState * count) {
      return fail(ErrorCode::kConfig,
                  "hardly any state of '" + study.entry.name +
                      "' is free of self-collision and inside its field",
                  study.entry.robot.mark().to_string(),
                  "give narrower `state_ranges` or a larger `extent_m`");
    }
    Eigen::VectorXd q(description.dof());
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      const JointRange& range = ranges[idx(j)];
      q[j] = uniform(random, range.lower, range.upper);
    }
    const std::span<const double> values = as_span(q);
    robot->sphere_centres(values, centres, scratch);
    const bool inside = std::ranges::all_of(
        centres, [&](const Eigen::Vector3d& centre) { return grid.contains(centre); });
    if (inside && !state_violation(robot, nothing, {}, 0.0, values)) states.push_back(std::move(q));
  }
  return states;
}

std::shared_ptr<const SceneField> true_field(std::span<const StudyBox> boxes) {
  std::vector<SceneObject> objects;
  for (const StudyBox& box : boxes) {
    Waypoint centre;
    centre.T_world_object.translation() = box.center();
    objects.push_back({"box", Box{box.sizes()}, {centre}, false});
  }
  const Eigen::Vector3d far_m = Eigen::Vector3d::Constant(kFar_m);
  return std::make_shared<const SceneField>(Scene(std::move(objects)), Stamp(),
                                            Eigen::AlignedBox3d(-far_m, far_m));
}

BoxMap::BoxMap(const GridSpec& grid) : grid_(grid), words_per_row_((grid.size_vox.x() + 63) / 64) {
  const std::size_t per_row = idx(words_per_row_);
  const std::size_t words = per_row * idx(grid.size_vox.y()) * idx(grid.size_vox.z());
  occupied_.assign(words, 0);
  known_.assign(words, ~std::uint64_t{0});
  const int rest = grid.size_vox.x() % 64;
  if (rest == 0) return;
  for (std::size_t w = per_row - 1; w < words; w += per_row) {
    known_[w] = (std::uint64_t{1} << rest) - 1;
  }
}

MapUpdate BoxMap::set_boxes(std::span<const StudyBox> boxes) {
  std::ranges::fill(occupied_, 0);
  for (const StudyBox& box : boxes) fill(box);
  MapUpdate update;
  update.sequence = ++sequence_;
  update.stamp = Stamp::from_seconds(static_cast<double>(sequence_));
  const int blocks = block_counts(grid_).prod();
  for (std::int32_t block = 0; block < blocks; ++block) update.changed_blocks.push_back(block);
  return update;
}

void BoxMap::fill(const StudyBox& box) {
  const Eigen::Array3d last = grid_.size_vox.cast<double>().array();
  const Eigen::Array3d lower = (box.min() - grid_.origin_m).array() / grid_.resolution_m;
  const Eigen::Array3d upper = (box.max() - grid_.origin_m).array() / grid_.resolution_m;
  const Eigen::Array3i from = lower.floor().max(0.0).min(last).cast<int>();
  const Eigen::Array3i to = upper.ceil().max(0.0).min(last).cast<int>();
  for (int z = from.z(); z < to.z(); ++z) {
    for (int y = from.y(); y < to.y(); ++y) {
      const std::size_t row = (idx(y) + idx(grid_.size_vox.y()) * idx(z)) * idx(words_per_row_);
      for (int x = from.x(); x < to.x(); ++x) {
        occupied_[row + idx(x / 64)] |= std::uint64_t{1} << (x % 64);
      }
    }
  }
}

Result<MapUpdate> BoxMap::integrate(const Frame&) {
  return fail(ErrorCode::kUnsupported, "a scene of boxes integrates no frames");
}

std::pair<int, int> states_of_pair(std::int64_t pair, int states) {
  int first = 0;
  for (std::int64_t left = states - 1; pair >= left; --left, ++first) pair -= left;
  return {first, first + 1 + static_cast<int>(pair)};
}

Result<ProblemOutcome> StudySolver::solve(const StudyScene& scene, std::int64_t pair,
                                          const Deadline& deadline) {
  const auto count = static_cast<std::int64_t>(states.size());
  const auto [start, goal] = states_of_pair(pair, static_cast<int>(count));
  ProblemOutcome outcome;
  outcome.problem = scene.scene * (count * (count - 1) / 2) + pair;
  outcome.start_free = scene.state_free[idx(start)] != 0;
  outcome.goal_free = scene.state_free[idx(goal)] != 0;
  if (skips_collisions && !(outcome.start_free && outcome.goal_free)) return outcome;
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    outcome.fields[kind] = SIDESTEP_TRY(solve_in(scene, kind, start, goal, deadline));
  }
  return outcome;
}

Result<FieldOutcome> StudySolver::solve_in(const StudyScene& scene, std::size_t kind, int start,
                                           int goal, const Deadline& deadline) {
  Problem problem = make_problem(robot, scene.fields[kind], study.planning, states[idx(start)],
                                 states[idx(goal)]);
  if (study.entry.support_states) problem.support_states = *study.entry.support_states;
  if (study.entry.duration_s) {
    problem.dt_s = *study.entry.duration_s / (problem.support_states - 1);
  }
  const Trajectory line = straight_line(problem);
  auto solution = SIDESTEP_TRY(
      call_stage(plugin_of(optimiser), [&] { return optimiser->solve(problem, line, deadline); }));
  if (deadline.expired()) return tl::make_unexpected(cancelled());
  FieldOutcome outcome;
  outcome.attempted = true;
  outcome.status = solution.status;
  outcome.iterations = solution.accepted_iterations;
  outcome.steps = solution.iterations;
  outcome.cost = solution.cost;
  outcome.solve_ms = solution.solve_ms;
  if (solution.trajectory.size() == 0) return outcome;
  const Stopwatch watch;
  const auto verdict = scene.check->check(solution.trajectory, 0.0, deadline);
  outcome.check_ms = watch.elapsed_ms();
  if (!verdict && deadline.expired()) return tl::make_unexpected(cancelled());
  if (!verdict) return error_of(verdict);
  outcome.collision_free = verdict->valid();
  outcome.clearance_m = verdict->min_clearance_m;
  return outcome;
}

}  // namespace sidestep
