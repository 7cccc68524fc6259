#include "study_parts.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <random>
#include <set>

#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/blocks.hpp>
#include <sidestep/runtime/call_plugin.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include <sidestep/runtime/unused_keys.hpp>

namespace sidestep {
namespace {

/// `over` laid on the map `under`, key by key.
Node laid_over(Node under, const Node& over) {
  if (!under.is_map()) return over;
  for (const Node::Entry& entry : over.entries()) {
    if (Node* value = under.find(entry.key)) {
      *value = entry.value;
    } else {
      under.entries().push_back(entry);
    }
  }
  return under;
}

GridSpec grid_of(const StudyRobotEntry& entry, double resolution_m) {
  const Eigen::Array3d voxels = (entry.extent_m.array() / resolution_m - 1e-6).ceil();
  return {entry.origin_m, resolution_m, voxels.max(1.0).min(1e5).cast<int>().matrix()};
}

void check_regions(const StudyRobotEntry& entry, const Node& node, std::vector<Error>& errors) {
  const auto require = [&](bool holds, const char* key, const char* what) {
    if (holds) return;
    const Node* value = node.find(key);
    errors.push_back((value != nullptr ? *value : node).error(what));
  };
  require((entry.box_lower_m.array() <= entry.box_upper_m.array()).all(), "box_upper_m",
          "'box_upper_m' must not be below 'box_lower_m'");
  require((entry.side_lower_m.array() >= 0.0).all(), "side_lower_m",
          "'side_lower_m' must not be below 0");
  require((entry.side_lower_m.array() <= entry.side_upper_m.array()).all(), "side_upper_m",
          "'side_upper_m' must not be below 'side_lower_m'");
  require((entry.extent_m.array() > 0.0).all(), "extent_m",
          "'extent_m' must be above 0 along each axis");
  require(!entry.duration_s || entry.support_states, "duration_s",
          "'duration_s' needs 'support_states', too");
}

void refuse_floor(const Node& planning, std::vector<Error>& errors) {
  const Node* floor = planning.find("floor");
  if (floor == nullptr || floor->is_null()) return;
  errors.push_back(floor->error("the scenes of a field study have no floor"));
}

/// The `planning` block of one robot; mistakes that the override brings in are told here.
PlanningSettings read_planning(const Node& common, const Node& own, std::vector<Error>& errors) {
  const UsedSchema used =
      used_schema("field_study", PlanningSettings::parameters().schema(), kUnusedOfStudyPlanning);
  const Node merged = own.is_map() ? laid_over(common, own) : common;
  std::vector<Error> before, found;
  check_against_used(common, used, before);
  check_against_used(merged, used, found);
  std::ranges::copy_if(found, std::back_inserter(errors), [&](const Error& error) {
    return std::ranges::find(before, error.describe(), &Error::describe) == before.end();
  });
  refuse_floor(own, errors);
  PlanningSettings settings;
  std::vector<Error> unreadable;  // no more than what the schema has told
  PlanningSettings::parameters().read(merged, settings, unreadable);
  return settings;
}

void check_field_block(const Configuration& configuration, Host& host, std::vector<Error>& errors) {
  const Node& block = block_of(configuration, "field");
  const auto plugin = host.find(PluginKind::kField, block);
  if (!plugin) return;  // told already
  if (const Node* sign = block.find("signed")) {
    errors.push_back(sign->error("'signed' is set by the study, which compares both",
                                 "leave it out of the `field` block"));
  }
  if (!has_parameter(plugin->schema, "signed")) {
    errors.push_back(block.error("the field '" + plugin->name + "' has no parameter 'signed'",
                                 "the study needs a field of both kinds, e.g. edt"));
  }
  for (const std::string& view : plugin->views) {
    if (view == OccupancyView::kViewName) continue;
    errors.push_back(block.error("the field '" + plugin->name + "' needs the view '" + view +
                                     "', and the study's scenes offer occupancy alone",
                                 "take a field that is made from occupancy, e.g. edt"));
  }
}

/// The robot's joints, their limits being the ranges that states are drawn from: `state_ranges`,
/// else their own. Appends an error for each unknown joint, empty range, value beyond a limit, and
/// joint without limits that has no range.
std::vector<Joint> read_state_ranges(const StudyRobotEntry& entry, const RobotDescription& robot,
                                     std::vector<Error>& errors) {
  std::vector<Joint> joints = robot.joints;
  for (const Node::Entry& item : entry.state_ranges.entries()) {
    const auto index = robot.joint_index(item.key);
    if (!index) {
      errors.push_back(unknown_name("robot '" + robot.name + "' has no joint", item.key,
                                    item.key_mark.to_string(), names_of(robot.joints)));
      continue;
    }
    Joint& joint = joints[static_cast<std::size_t>(*index)];
    const auto bounds = item.value.as_doubles(2);
    if (!bounds) {
      errors.push_back(bounds.error());
      joint.lower = joint.upper = 0.0;
    } else if (!((*bounds)[0] <= (*bounds)[1]) || (*bounds)[0] < joint.lower ||
               (*bounds)[1] > joint.upper) {
      errors.push_back(item.value.error(
          "the range of joint '" + item.key + "' must be ascending and within its limits [" +
          detail::number_text(joint.lower) + ", " + detail::number_text(joint.upper) + "]"));
    } else {
      joint.lower = (*bounds)[0];
      joint.upper = (*bounds)[1];
    }
  }
  for (const Joint& joint : joints) {
    if (std::isfinite(joint.lower) && std::isfinite(joint.upper)) continue;
    errors.push_back(entry.robot.error("joint '" + joint.name + "' has no limits",
                                       "give it a range in `state_ranges`"));
  }
  return joints;
}

/// What is wrong with one robot and needs the robot to be known.
void check_robot(const StudyRobot& robot, const Node& field, Host& host,
                 std::vector<Error>& errors) {
  std::vector<Error> told;
  host.check(PluginKind::kRobot, robot.entry.robot, told);
  if (!told.empty()) return;
  const auto model = host.create<RobotModel>(robot.entry.robot);
  if (!model) {
    errors.push_back(model.error());
    return;
  }
  const RobotDescription& description = (*model)->description();
  (void)read_state_ranges(robot.entry, description, errors);
  const Node* limit = field.find("max_distance_m");
  const double limit_m = limit != nullptr ? limit->as_double().value_or(0.0) : 0.0;
  double radius_m = 0.0;
  for (const CollisionSphere& sphere : description.spheres) {
    radius_m = std::max(radius_m, sphere.radius_m);
  }
  const double reach_m = robot.planning.epsilon_m + radius_m;
  if (limit_m > 0.0 && limit_m < reach_m) {
    errors.push_back(limit->error("obstacle costs of '" + robot.entry.name + "' look " +
                                      detail::number_text(reach_m) +
                                      " m far, beyond 'max_distance_m'",
                                  "0 for no limit"));
  }
}

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

}  // namespace

FieldStudy read_field_study(const Configuration& configuration, std::vector<Error>& errors) {
  FieldStudy study;
  const Node& experiment = block_of(configuration, "experiment");
  const Node& check = block_of(configuration, "check");  // may be left out
  if (!read_entry(experiment, study.settings, errors)) return study;
  if (!check.is_null() && !read_entry(check, study.check, errors)) return study;
  if (study.check.wants_certificate()) {
    errors.push_back(
        check.find("certificate")
            ->error(
                "'certificate' is for plans among shapes, and without effect among random fields",
                "leave it out"));
  }
  refuse_floor(block_of(configuration, "planning"), errors);
  const Node& list = *experiment.find("robots");
  if (list.items().empty()) errors.push_back(list.error("there is no robot to study"));
  std::set<std::string> names;
  for (std::size_t r = 0; r < study.settings.robots.size(); ++r) {
    const StudyRobotEntry& entry = study.settings.robots[r];
    const Node& node = list.items()[r];
    take_name(*node.find("name"), "a robot", names, errors);
    check_regions(entry, node, errors);
    const double resolution_m = entry.resolution_m.value_or(study.settings.resolution_m);
    study.robots.push_back(
        {entry, read_planning(block_of(configuration, "planning"), entry.planning, errors),
         grid_of(entry, resolution_m)});
  }
  return study;
}

void check_field_study(const Configuration& configuration, Host& host, std::vector<Error>& errors) {
  const FieldStudy study = read_field_study(configuration, errors);
  check_field_block(configuration, host, errors);
  for (const StudyRobot& robot : study.robots) {
    if (!robot.entry.robot.is_map()) continue;
    check_robot(robot, block_of(configuration, "field"), host, errors);
  }
}

Parameters<PublishedOutcome> PublishedOutcome::parameters() {
  using P = PublishedOutcome;
  return Parameters<P>()
      .add("failure_percent", &P::failure_percent, "Failure rate, as printed.",
           {.unit = "%", .required = true})
      .add("iterations_mean", &P::iterations_mean, "Mean number of iterations.", {.required = true})
      .add("iterations_sd", &P::iterations_sd, "Its standard deviation.", {.required = true})
      .add("cost_mean", &P::cost_mean, "Mean cost of valid trajectories.", {.required = true})
      .add("cost_sd", &P::cost_sd, "Its standard deviation.", {.required = true});
}

Parameters<PublishedComparison> PublishedComparison::parameters() {
  using P = PublishedComparison;
  return Parameters<P>()
      .add("unsigned", &P::unsigned_field, "With the unsigned field.", {.required = true})
      .add("signed", &P::signed_field, "With the signed field.", {.required = true});
}

Parameters<StudyRobotEntry> StudyRobotEntry::parameters() {
  using E = StudyRobotEntry;
  return Parameters<E>()
      .add("name", &E::name, "Name of the robot in results.", {.required = true})
      .add("robot", &E::robot, "A robot's plugin and parameters.",
           {.required = true, .plugin = PluginKind::kRobot})
      .add("planning", &E::planning,
           "Values of the `planning` block that this robot has of its own.")
      .add("state_ranges", &E::state_ranges,
           "Ranges that states are drawn from, {JOINT: [lower, upper]}; else the joint's limits.")
      .add("box_lower_m", &E::box_lower_m, "Lower corner of the region of boxes' centres.",
           {.unit = "m"})
      .add("box_upper_m", &E::box_upper_m, "Upper corner of the region of boxes' centres.",
           {.unit = "m"})
      .add("side_lower_m", &E::side_lower_m, "Least sides of boxes.", {.unit = "m"})
      .add("side_upper_m", &E::side_upper_m, "Largest sides of boxes.", {.unit = "m"})
      .add("origin_m", &E::origin_m, "Lower corner of the fields.", {.unit = "m"})
      .add("extent_m", &E::extent_m, "Edges of the fields.", {.unit = "m"})
      .add("resolution_m", &E::resolution_m, "Edge of a voxel, where it is not that of the study.",
           {.unit = "m", .min = 1e-3, .max = 1.0})
      .add("support_states", &E::support_states,
           "Support states of every trajectory; left out: as `planning` says.",
           {.min = 3, .max = 10000})
      .add("duration_s", &E::duration_s,
           "Duration of every trajectory, with support_states; left out: dt_s between them.",
           {.unit = "s", .min = 1e-3, .max = 1e4})
      .add("published", &E::published, "What somebody printed, to stand beside ours.");
}

Parameters<FieldStudySettings> FieldStudySettings::parameters() {
  using S = FieldStudySettings;
  return experiment_parameters<S>()
      .add("robots", &S::robots, "The robots to study, in this order.", {.required = true})
      .add("states", &S::states, "States of each robot; every pair of them is a motion.",
           {.min = 2, .max = 1000})
      .add("scenes", &S::scenes, "Scenes for each robot.", {.min = 1, .max = 100000})
      .add("boxes_per_scene", &S::boxes_per_scene, "Boxes in each scene.", {.min = 0, .max = 10000})
      .add("resolution_m", &S::resolution_m, "Edge of a voxel of the fields.",
           {.unit = "m", .min = 1e-3, .max = 1.0})
      .add("start_or_goal_in_collision", &S::start_or_goal_in_collision,
           "Problems whose start or goal collides, which none can solve: solve them like all "
           "others, or skip them.",
           {.choices = {"solve", "skip"}})
      .add("confidence", &S::confidence, "Of the confidence intervals.",
           {.min = 0.5, .max = 0.9999})
      .add("bootstrap_samples", &S::bootstrap_samples,
           "Draws of scenes that intervals of means and differences are taken from.",
           {.min = 100, .max = 1000000})
      .add("published_as", &S::published_as, "Head of the columns of published figures.");
}

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
  const std::vector<Joint> joints = read_state_ranges(study.entry, description, errors);
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
      q[j] = uniform(random, joints[idx(j)].lower, joints[idx(j)].upper);
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

BoxMap::BoxMap(const GridSpec& grid)
    : grid_(grid),
      words_per_row_((grid.size_vox.x() + 63) / 64),
      occupied_(idx(words_per_row_) * idx(grid.size_vox.y()) * idx(grid.size_vox.z())),
      known_(occupied_) {
  fill({grid.origin_m, grid.upper_m()}, known_);
}

MapUpdate BoxMap::set_boxes(std::span<const StudyBox> boxes) {
  std::ranges::fill(occupied_, 0);
  for (const StudyBox& box : boxes) fill(box, occupied_);
  MapUpdate update;
  update.sequence = ++sequence_;
  update.stamp = Stamp::from_seconds(static_cast<double>(sequence_));
  update.changed_blocks.resize(idx(block_counts(grid_).prod()));
  std::iota(update.changed_blocks.begin(), update.changed_blocks.end(), 0);
  return update;
}

void BoxMap::fill(const StudyBox& box, std::vector<std::uint64_t>& bits) const {
  const Eigen::Array3d last = grid_.size_vox.cast<double>().array();
  const Eigen::Array3d lower = (box.min() - grid_.origin_m).array() / grid_.resolution_m;
  const Eigen::Array3d upper = (box.max() - grid_.origin_m).array() / grid_.resolution_m;
  const Eigen::Array3i from = lower.floor().max(0.0).min(last).cast<int>();
  const Eigen::Array3i to = upper.ceil().max(0.0).min(last).cast<int>();
  for (int z = from.z(); z < to.z(); ++z) {
    for (int y = from.y(); y < to.y(); ++y) {
      const std::size_t row = (idx(y) + idx(grid_.size_vox.y()) * idx(z)) * idx(words_per_row_);
      for (int x = from.x(); x < to.x(); ++x) {
        bits[row + idx(x / 64)] |= std::uint64_t{1} << (x % 64);
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
  const auto cancelled = fail(ErrorCode::kCancelled, "the study was interrupted");
  if (deadline.expired()) return cancelled;
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
  if (!verdict && deadline.expired()) return cancelled;
  if (!verdict) return error_of(verdict);
  outcome.collision_free = verdict->valid();
  outcome.clearance_m = verdict->min_clearance_m;
  return outcome;
}

}  // namespace sidestep
