#include "closed_loop/replan_settings.hpp"

#include <algorithm>

#include <sidestep/runtime/entry_reading.hpp>

#include "settings/blocks.hpp"

namespace sidestep {
namespace {

const std::vector<std::string> kGuesses(kReplanGuesses.begin(), kReplanGuesses.end());

template <class Settings>
bool read_checked(const Configuration& configuration, std::string_view name, Settings& into) {
  const Node* block = configuration.root.find(name);
  return block == nullptr || read_entry(*block, into);
}

std::vector<std::string> joint_names(const RobotDescription& robot) {
  return names_of(robot.joints);
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
                                    entry.key_mark.to_string(), joint_names(robot)));
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
  std::vector<OptionMistake> mistakes;
  if (settings.solve_limit_s >= settings.takeover_s) {
    mistakes.push_back({{"solve_limit_s", "takeover_s"}, "must be less than takeover_s", {}});
  }
  report_mistakes(block, mistakes, errors);
  const Node* escalation = block.find("escalation");
  const SourceMark mark = escalation != nullptr ? escalation->mark() : block.mark();
  for (const std::string& guess : settings.escalation) {
    if (std::ranges::find(kGuesses, guess) == kGuesses.end()) {
      errors.push_back(unknown_name("there is no first guess", guess, mark.to_string(), kGuesses));
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

}  // namespace

void read_loop_blocks(const Configuration& configuration, ReplanConfiguration& into,
                      std::vector<Error>& errors) {
  ReplannerBlock replanner;
  if (read_checked(configuration, "replanner", replanner)) {
    check_replanner(configuration, replanner, errors);
  }
  into.replanner = replanner;
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
  if (const auto& random = read.experiment.random) {
    read.start_ranges = read_ranges(random->start, description, errors);
    read.goal_ranges = read_ranges(random->goal, description, errors);
  }
  return read;
}

Parameters<ReplannerBlock> ReplannerBlock::parameters() {
  using S = ReplannerSettings;
  return Parameters<ReplannerBlock>()
      .add("replan_period_s", &S::replan_period_s,
           "Least time from one replan's begin to the next one's.",
           {.unit = "s", .min = 1e-3, .max = 60.0})
      .add("takeover_s", &S::takeover_s, "From a replan's begin to when its trajectory takes over.",
           {.unit = "s", .min = 1e-3, .max = 60.0})
      .add("solve_limit_s", &S::solve_limit_s,
           "For all attempts of one replan; less than takeover_s.",
           {.unit = "s", .min = 1e-4, .max = 60.0})
      .add("horizon_s", &S::horizon_s,
           "Where no trajectory is free all the way, one that is so for this long may do.",
           {.unit = "s", .min = 0.0, .max = 3600.0})
      .add(
          "stopgap_after_s", &S::stopgap_after_s,
          "By the wall's clock: after so long no further first guess is tried where one has led to "
          "a trajectory that is free for horizon_s.",
          {.unit = "s", .min = 0.0, .max = 60.0})
      .add("stop_lead_s", &S::stop_lead_s, "From the decision to stop to when braking begins.",
           {.unit = "s", .min = 0.0, .max = 60.0})
      .add("max_state_age_s", &S::max_state_age_s,
           "A measured state older than this leads to a stop.",
           {.unit = "s", .min = 1e-3, .max = 3600.0})
      .add("max_map_age_s", &S::max_map_age_s, "A map older than this leads to a stop.",
           {.unit = "s", .min = 1e-3, .max = 3600.0})
      .add("goal_tolerance", &S::goal_tolerance, "Of every joint at the goal (m, rad).",
           {.min = 1e-6, .max = 10.0})
      .add(
          "obstacle_speed_mps", &S::obstacle_speed_mps,
          "Largest speed of what moves: while the robot moves, it can come to rest before anything "
          "seen moving could reach it. 0: what moves is an obstacle like any other.",
          {.unit = "m/s", .min = 0.0, .max = 20.0})
      .add("rest_speed", &S::rest_speed, "Joints that are slower count as at rest (m/s, rad/s).",
           {.min = 1e-6, .max = 10.0})
      .add("tracking_tolerance", &S::tracking_tolerance,
           "Largest distance of a joint from what it follows (m, rad); beyond it the robot stops.",
           {.min = 1e-6, .max = 100.0})
      .add("margin_m", &S::margin_m, "Clearance that spheres must keep from obstacles.",
           {.unit = "m", .min = 0.0, .max = 10.0})
      .add(
          "unseen_start_m", &S::unseen_start_m,
          "How far from where the robot starts the links that stand on the floor may move in space "
          "that no frame has seen: what is known to be free there. Farther off, the centres of "
          "their spheres keep to what has been seen, as far as a stop takes. Left out: they may be "
          "anywhere.",
          {.unit = "m", .min = 0.0, .max = 100.0})
      .add("max_step_m", &S::max_step_m, "First spacing of validity checks, as sphere motion.",
           {.unit = "m", .min = 1e-4, .max = 1.0})
      .add("stop_reserve", &S::stop_reserve,
           "A stop begins no later than when what blocks the trajectory is so many times as far "
           "away, in time, as the robot needs to come to rest.",
           {.min = 1.0, .max = 100.0})
      .add(
          "cost_tolerance", &S::cost_tolerance,
          "A valid trajectory is replanned, too, once its cost in the newest map has grown by this "
          "share of what it was where it was planned; 0: never.",
          {.min = 0.0, .max = 1e9})
      .add("hysteresis", &S::hysteresis,
           "Share by which a new trajectory must then be cheaper to be taken.",
           {.min = 0.0, .max = 1.0})
      .add("escalation", &S::escalation,
           "First guesses of a replan, in order: refit, straight_line, perturbed, sampled (which "
           "needs a `sampler`), after_stop.");
}

Parameters<LatencyEntry> LatencyEntry::parameters() {
  return Parameters<LatencyEntry>().add(
      "mapping_s", &LatencyEntry::mapping_s,
      "From taking a frame to its published field; no other is taken meanwhile.",
      {.unit = "s", .min = 0.0, .max = 60.0});
}

Parameters<RandomEntry> RandomEntry::parameters() {
  using E = RandomEntry;
  return Parameters<E>()
      .add("start", &E::start, "Ranges of joints of the start, e.g. {odom_x: [-1.0, 1.0]}.")
      .add("goal", &E::goal, "Ranges of joints of the goal.")
      .add("clearance_m", &E::clearance_m,
           "That a drawn start or goal keeps from everything in the true scene.",
           {.unit = "m", .min = 0.0, .max = 10.0})
      .add("draws", &E::draws, "How often to draw before giving up.", {.min = 1, .max = 1e6});
}

Parameters<ReplanSettings> ReplanSettings::parameters() {
  using S = ReplanSettings;
  return Parameters<S>()
      .add("type", &S::type, "Type of the experiment.", {.required = true})
      .add("seed", &S::seed, "Seed of everything random in the run.", {.min = 0})
      .add("threads", &S::threads, "Threads to work with; 0 for one per core.",
           {.min = 0, .max = 1024})
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
      .add("latency", &S::latency,
           "What computing is charged with in lockstep; planning with replanner.takeover_s.")
      .add("start", &S::start, "Where the robot starts.", {.required = true})
      .add("goal", &S::goal,
           "Where the robot is to be; with `end_effector`, where the search for that begins.",
           {.required = true})
      .add("end_effector", &S::end_effector,
           "Where a link is to be at the end; the goal configuration is found by it.")
      .add("orientation_costs", &S::orientation_costs,
           "Links that are to keep an orientation along the way.")
      .add("axis_costs", &S::axis_costs,
           "Links of which an axis is to keep a direction along the way, e.g. upright.")
      .add("posture_cost", &S::posture_cost, "A posture that is preferred along the way.")
      .add("random", &S::random, "What is drawn anew for each episode.")
      .add("truth", &S::truth,
           "How maps are held against the true scene, frame by frame; in lockstep only, since it "
           "takes time.")
      .add("pictures", &S::pictures, "Pictures from above of an episode, spread over its time.",
           {.min = 0, .max = 24});
}

}  // namespace sidestep
