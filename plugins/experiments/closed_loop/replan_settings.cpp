#include "closed_loop.hpp"

#include <algorithm>
#include <random>

#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/measures/source_facts.hpp>
#include <sidestep/runtime/blocks.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include <sidestep/runtime/shape_check.hpp>

namespace sidestep {
namespace {

template <class Settings>
bool read_checked(const Configuration& configuration, std::string_view name, Settings& into) {
  const Node* block = configuration.root.find(name);
  return block == nullptr || read_entry(*block, into);
}

std::vector<RandomJoint> read_ranges(const Node& block, const RobotDescription& robot,
                                     std::vector<Error>& errors) {
  std::vector<RandomJoint> ranges;
  if (block.is_null()) return ranges;
  if (!block.is_map()) {
    errors.push_back(block.error("expected a map of joint names to ranges, found " + block.kind(),
                                 "e.g. {odom_x: [-1.0, 1.0]}"));
    return ranges;
  }
  for (const Node::Entry& entry : block.entries()) {
    const auto joint = robot.joint_index(entry.key);
    if (!joint) {
      errors.push_back(unknown_name("robot '" + robot.name + "' has no joint", entry.key,
                                    entry.key_mark.to_string(), names_of(robot.joints)));
      continue;
    }
    const auto range = entry.value.as_doubles(2);
    if (!range) {
      errors.push_back(range.error());
      continue;
    }
    const Joint& its = robot.joints[static_cast<std::size_t>(*joint)];
    const double lower = range->front(), upper = range->back();
    if (lower > upper) {
      errors.push_back(entry.value.error("the range of joint '" + its.name + "' is upside down"));
    } else if (lower < its.lower || upper > its.upper) {
      errors.push_back(entry.value.error(
          "the range of joint '" + its.name + "' goes beyond its limits [" +
          detail::number_text(its.lower) + ", " + detail::number_text(its.upper) + "]"));
    }
    ranges.push_back({static_cast<std::size_t>(*joint), lower, upper});
  }
  return ranges;
}

void check_replanner(const Configuration& configuration, const ReplannerSettings& settings,
                     std::vector<Error>& errors) {
  const Node& block = block_of(configuration, "replanner");
  if (settings.solve_limit_s >= settings.takeover_s) {
    report_mistakes(block, {{{"solve_limit_s", "takeover_s"}, "must be less than takeover_s", {}}},
                    errors);
  }
  const Node* escalation = block.find("escalation");
  const SourceMark mark = escalation != nullptr ? escalation->mark() : block.mark();
  for (const std::string& guess : settings.escalation) {
    if (std::ranges::count(kReplanGuesses, guess) == 0) {
      errors.push_back(unknown_name("there is no first guess", guess, mark.to_string(),
                                    {kReplanGuesses.begin(), kReplanGuesses.end()}));
    } else if (guess == "sampled" && block_of(configuration, "sampler").is_null()) {
      errors.push_back({ErrorCode::kConfig,
                        "the first guess 'sampled' needs a `sampler` block, and there is none",
                        mark.to_string(), "add e.g. sampler: {plugin: ompl}", nullptr});
    }
  }
}

/// A loop judges by its own blocks: what `check` asks for beside contacts would be without effect.
void check_for_plans_only(const Node& block, const CheckSettings& settings,
                          std::vector<Error>& errors) {
  const CheckSettings usual;
  const auto refuse = [&](const char* key, double value, double by_default, const char* hint) {
    if (value == by_default) return;
    errors.push_back(block.find(key)->error(
        "'" + std::string(key) + "' is for plans, and without effect in a closed loop", hint));
  };
  refuse("margin_m", settings.margin_m, usual.margin_m, "set replanner.margin_m");
  refuse("max_step_m", settings.max_step_m, usual.max_step_m, "set replanner.max_step_m");
  refuse("shape_max_step_m", settings.shape_max_step_m, usual.shape_max_step_m, "leave it out");
  refuse("speed_fraction", settings.speed_fraction, usual.speed_fraction,
         "set planning.speed_fraction");
  refuse("acceleration_fraction", settings.acceleration_fraction, usual.acceleration_fraction,
         "set planning.acceleration_fraction");
}

/// Start and goal of the world's episode: what is random is drawn until it is free of itself and of
/// the scene at that time.
Result<void> draw_ends(const ReplanConfiguration& settings, ReplanWorld& world) {
  const auto draw = [&](const std::string& what, Eigen::VectorXd q,
                        const std::vector<RandomJoint>& ranges,
                        double scene_time_s) -> Result<Eigen::VectorXd> {
    if (ranges.empty()) return q;
    const RandomEntry& random = *settings.experiment.random;
    ShapeObstacles obstacles;
    obstacles.scene = world.scene;
    obstacles.scene_time_s = scene_time_s;
    ShapeCheckSettings touching;
    if (world.scene) {
      const auto& allowed = settings.check.allowed_contacts;
      touching.allowed_contacts.assign(allowed.begin(), allowed.end());
    }
    const auto check = SIDESTEP_TRY(make_shape_check(world.robot, obstacles, touching));
    std::mt19937_64 generator(derive_seed(world.seed, what));
    for (int i = 0; i < random.draws; ++i) {
      for (const RandomJoint& range : ranges) {
        const double share = std::uniform_real_distribution<double>(0.0, 1.0)(generator);
        q[static_cast<Eigen::Index>(range.joint)] =
            range.lower + share * (range.upper - range.lower);
      }
      Trajectory standing = make_trajectory(world.robot->description().dof(), 2, 1e-3);
      for (int state : {0, 1}) std::copy(q.begin(), q.end(), standing.q(state).begin());
      const auto verdict = SIDESTEP_TRY(check->check(standing, 0.0, Deadline()));
      if (verdict.valid() && verdict.min_clearance_m >= random.clearance_m) return q;
    }
    return fail(ErrorCode::kConfig,
                "no free " + what + " was found in " + std::to_string(random.draws) + " draws",
                "experiment.random." + what, "wider ranges, or less clearance_m");
  };
  world.q_start = SIDESTEP_TRY(draw("start", world.q_start, settings.start_ranges, 0.0));
  world.q_goal = SIDESTEP_TRY(
      draw("goal", world.q_goal, settings.goal_ranges, settings.experiment.duration_s));
  return {};
}

/// The source's block, told who walks there, or that nothing moves.
Node source_block(Node block, const Node& people, bool is_alone) {
  if (!people.is_null()) block = with_entry(std::move(block), "people", people);
  if (!is_alone) return block;
  return with_entry(std::move(block), "alone", plain_scalar("true", {"the free run", 0, 0}));
}

/// The executor's block, which says where the robot stands if it is an executor that can be told.
/// In lockstep no robot is a real one, which would know.
Node executor_block(const Node& block, const ReplanWorld& world, bool is_lockstep,
                    ExperimentContext& context) {
  const auto info = context.host.find(PluginKind::kExecutor, block);
  if (!info || block.find("start") != nullptr) return block;
  if (!has_parameter(info->schema, "start")) {
    if (is_lockstep) {
      context.log.warn("executor " + info->name +
                       " has no parameter 'start' (planning/executor.hpp): its robot begins where "
                       "it is, not at experiment.start");
    }
    return block;
  }
  const SourceMark mark{"the start of the episode", 0, 0};
  Node::Map start;
  const RobotDescription& robot = world.robot->description();
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const double q = world.q_start[static_cast<Eigen::Index>(j)];
    start.push_back({robot.joints[j].name, mark, plain_scalar(detail::number_text(q), mark)});
  }
  return with_entry(block, "start", Node(std::move(start), mark));
}

/// What is declared before the task.
Parameters<ReplanSettings> loop_parameters() {
  using S = ReplanSettings;
  return experiment_parameters<S>()
      .add(
          "clock", &S::clock,
          "lockstep: simulated time in steps, the same for the same seed; wall: real time, mapping "
          "in a thread of its own.",
          {.choices = {"lockstep", "wall"}})
      .add("duration_s", &S::duration_s, "Most time of an episode.",
           {.unit = "s", .min = 0.01, .max = 86400.0})
      .add("step_s", &S::step_s, "Longest time between two steps of the planning loop.",
           {.unit = "s", .min = 1e-4, .max = 0.01})
      .add("episodes", &S::episodes, "How often to do it, each time in a fresh world.",
           {.min = 1, .max = 1e6})
      .add("first_episode", &S::first_episode,
           "Number of the first one: any episode can be run again by itself.",
           {.min = 0, .max = 1e6})
      .add("perception", &S::perception,
           "cameras: the source's frames are mapped; truth: the loop is given the exact field of "
           "what stands and the true tracks of what moves, in lockstep only.",
           {.choices = {"cameras", "truth"}})
      .add("goes_on_without", &S::goes_on_without,
           "Those of `sources` without which the robot goes on, by what the others see; it stops "
           "without any other.")
      .add("cases", &S::cases,
           "A file of CrowdNav's cases (JSON): episode k has the robot's base, and people that "
           "walk by ORCA, start and go where case k says.")
      .add("people", &S::people,
           "A recording of people (CSV of person,time_s,x_m,y_m): in each episode the robot's base "
           "crosses 10 m of it, from a time and in a direction that are drawn.")
      .add("free_run", &S::free_run,
           "Whether each episode is run without people, too, for comparison.")
      .add("latency", &S::latency,
           "What sensing and mapping are charged with in lockstep; planning with "
           "replanner.takeover_s.")
      .add("start", &S::start, "Where the robot starts.", {.required = true})
      .add("goal", &S::goal,
           "Where the robot is to be; with `end_effector`, where the search for that begins.",
           {.required = true});
}

}  // namespace

void read_loop_blocks(const Configuration& configuration, ReplanConfiguration& into,
                      std::vector<Error>& errors) {
  if (read_checked(configuration, "replanner", into.replanner)) {
    check_replanner(configuration, into.replanner, errors);
  }
  (void)read_checked(configuration, "planning", into.planning);
  if (read_checked(configuration, "check", into.check)) {
    check_for_plans_only(block_of(configuration, "check"), into.check, errors);
  }
}

ReplanConfiguration read_replan_configuration(const Configuration& configuration,
                                              const std::shared_ptr<const RobotModel>& robot,
                                              std::vector<Error>& errors) {
  ReplanConfiguration read;
  const RobotDescription& description = robot->description();
  read_loop_blocks(configuration, read, errors);
  const Node& experiment = block_of(configuration, "experiment");
  if (!read_checked(configuration, "experiment", read.experiment)) return read;
  read.q_start = read_robot_state(*experiment.find("start"), description, errors);
  read.q_goal = read_robot_state(*experiment.find("goal"), description, errors);
  read.task = read_task(experiment, robot, errors);
  read.cases = CrowdCases::read(read.experiment, experiment, errors);
  if (read.cases && !description.planar_base()) {
    errors.push_back(experiment.error("robot '" + description.name +
                                      "' has no base that moves in the "
                                      "plane, which the cases among people need"));
  }
  if (read.experiment.sees_truth() && !read.experiment.is_lockstep()) {
    errors.push_back(experiment.find("perception")->error("the truth is known in lockstep only"));
  }
  const Node& sources = block_of(configuration, "sources");
  for (const std::string& name : read.experiment.goes_on_without) {
    const Node* const source = sources.find(name);
    if (source != nullptr && !source->is_null()) continue;
    std::vector<std::string> names;
    for (const Node::Entry& entry : sources.entries()) names.push_back(entry.key);
    errors.push_back(unknown_name("there is no source", name,
                                  experiment.find("goes_on_without")->mark().to_string(), names));
  }
  if (const auto& random = read.experiment.random) {
    read.start_ranges = read_ranges(random->start, description, errors);
    read.goal_ranges = read_ranges(random->goal, description, errors);
  }
  return read;
}

Parameters<ReplanSettings> ReplanSettings::parameters() {
  using S = ReplanSettings;
  return declare_task(with_policies(loop_parameters()),
                      "Where a link is to be at the end; the goal configuration is found by it.")
      .add("random", &S::random, "What is drawn anew for each episode.")
      .add("truth", &S::truth,
           "How maps are held against the true scene, frame by frame; in lockstep only, since it "
           "takes time.")
      .add("tracks", &S::tracks,
           "Tracks what moves; `truth` holds the tracks against the true scene, too.")
      .add("pictures", &S::pictures, "Pictures from above of an episode, spread over its time.",
           {.min = 0, .max = 24});
}

Result<ReplanWorld> make_replan_world(ExperimentContext& context,
                                      const ReplanConfiguration& settings,
                                      const std::shared_ptr<const RobotModel>& robot,
                                      std::int64_t episode, const ReplanWorld* alone_in) {
  const std::uint64_t seed = derive_seed(context.seed, "episode/" + std::to_string(episode));
  ReplanWorld world;
  world.seed = seed;
  world.clock = std::make_unique<EpisodeClock>();
  world.motion = std::make_shared<RobotMotion>();
  world.slot = std::make_unique<SnapshotSlot>();
  world.robot = robot;
  RunLoan loan{robot, world.motion, world.clock.get(), seed, nullptr};
  const auto make = [&]<class Plugin>(const Node& block, PluginPtr<Plugin>& into) -> Result<void> {
    into = SIDESTEP_TRY(context.host.create<Plugin>(block, loan));
    return {};
  };
  const auto block = [&](std::string_view name) -> const Node& {
    return block_of(context.configuration, name);
  };
  world.q_start = settings.q_start;
  world.q_goal = settings.q_goal;
  Node people;
  if (settings.cases) {
    const CrowdCase its = settings.cases->of(episode, seed);
    const std::array base = *robot->description().planar_base();  // it has one: that was checked
    people = its.people;
    for (const int axis : {0, 1}) {
      const auto joint = base[idx(axis)];
      world.q_start[joint] = its.start_m[axis];
      world.q_goal[joint] = its.goal_m[axis];
    }
  }
  SIDESTEP_TRY(make(source_block(block("source"), people, alone_in != nullptr), world.source));
  world.scene = loan.scene = SIDESTEP_TRY(true_scene(world.source));
  world.truth = loan.truth = dynamic_cast<GroundTruth*>(world.source.get());
  if (settings.experiment.sees_truth() && world.truth == nullptr) {
    return fail(ErrorCode::kUnsupported,
                plugin_of(world.source) +
                    " does not know the truth that experiment.perception asks "
                    "for");
  }
  if (alone_in != nullptr) {
    world.q_start = alone_in->q_start;
    world.q_goal = alone_in->q_goal;
  } else {
    SIDESTEP_TRY(draw_ends(settings, world));
  }
  for (const Node::Entry& entry : block("sources").entries()) {
    if (entry.value.is_null()) continue;  // a base's, taken back
    FurtherSource& further = world.further.emplace_back();
    further.name = entry.key;
    further.is_needed = std::ranges::count(settings.experiment.goes_on_without, entry.key) == 0;
    loan.seed = derive_seed(seed, "sources/" + entry.key);  // its noise is its own
    SIDESTEP_TRY(make(entry.value, further.source));
  }
  loan.seed = seed;
  SIDESTEP_TRY(make(block("mapper"), world.mapper));
  SIDESTEP_TRY(make(block("field"), world.field_builder));
  SIDESTEP_TRY(make(block("optimiser"), world.optimiser));
  if (!block("sampler").is_null()) SIDESTEP_TRY(make(block("sampler"), world.sampler));
  if (!block("predictor").is_null()) SIDESTEP_TRY(make(block("predictor"), world.predictor));
  if (!block("gaze").is_null()) SIDESTEP_TRY(make(block("gaze"), world.gaze));
  SIDESTEP_TRY(
      make(executor_block(block("executor"), world, settings.experiment.is_lockstep(), context),
           world.executor));
  world.true_robot = dynamic_cast<TrueRobot*>(world.executor.get());
  if (!block("localiser").is_null()) {
    SIDESTEP_TRY(make(block("localiser"), world.localiser));
    world.base = SIDESTEP_TRY(BaseJoints::of(*robot));
    world.localised =
        std::make_unique<LocalisedExecutor>(*world.executor, *world.base, *world.slot);
  }
  return world;
}

}  // namespace sidestep
