#include <sidestep/core/index.hpp>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/goal_source.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/checked_robot.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include <sidestep/runtime/standing_floor.hpp>
#include "closed_loop.hpp"

namespace sidestep {
namespace {

using State = GoalReport::State;

/// The `experiment` block of a deploy experiment.
struct DeploySettings : ReplanSettings {
  int goals = 0;
  double feedback_period_s = 0.2;
  std::optional<PostureCostEntry> posture_cost;

  DeploySettings() { clock = "wall"; }

  static Parameters<DeploySettings> parameters() {
    using S = DeploySettings;
    return with_policies(experiment_parameters<S>())
        .add("clock", &S::clock,
             "wall: real time, mapping in a thread of its own; lockstep: simulated time in steps.",
             {.choices = {"lockstep", "wall"}})
        .add(
            "goals", &S::goals,
            "Ends after so many; 0: when no more can come, or on Ctrl-C, which brings the robot to "
            "rest.",
            {.min = 0, .max = 1e6})
        .add("duration_s", &S::duration_s, "Most time for one goal; the robot then stops.",
             {.unit = "s", .min = 0.01, .max = 86400.0})
        .add("step_s", &S::step_s, "Longest time between two steps of the planning loop.",
             {.unit = "s", .min = 1e-4, .max = 0.01})
        .add("feedback_period_s", &S::feedback_period_s,
             "How often whoever asked hears how far there is to go.",
             {.unit = "s", .min = 0.01, .max = 60.0})
        .add("latency", &S::latency,
             "What sensing and mapping are charged with in lockstep; planning with "
             "replanner.takeover_s.")
        .add("start", &S::start,
             "Where the robot starts, for an executor that can be told; a real one knows better.",
             {.required = true})
        .add("posture_cost", &S::posture_cost,
             "A posture that is preferred along the way to each goal.")
        .add("pictures", &S::pictures, "Pictures from above of the way to a goal.",
             {.min = 0, .max = 24});
  }
};

/// All that a configuration says of a deploy experiment; goal and task are those of each request.
struct DeployConfiguration : ReplanConfiguration {
  DeploySettings deploy;
  std::vector<CostTerm> always;  ///< Of each task, besides its own.
};

/// A request that has been understood.
struct Goal {
  std::string id;
  bool is_stop = false;  ///< Nothing but to come to rest; what follows is empty.
  Eigen::VectorXd q;
  Task task;
};

/// What a request may say.
struct GoalEntry : TaskEntry {
  RobotStateEntry goal;

  static Parameters<GoalEntry> parameters() {
    auto parameters = Parameters<GoalEntry>().add(
        "goal", &GoalEntry::goal, "Where the robot is to be; joints left out stay as they are.");
    return declare_task(std::move(parameters), "Where a link is to be at the end.");
  }
};

/// As read_replan_configuration().
DeployConfiguration read_deploy_configuration(const Configuration& configuration,
                                              const std::shared_ptr<const RobotModel>& robot,
                                              std::vector<Error>& errors) {
  DeployConfiguration read;
  read_loop_blocks(configuration, read, errors);
  const Node& experiment = block_of(configuration, "experiment");
  if (!read_entry(experiment, read.deploy)) return read;
  read.experiment = read.deploy;
  read.q_start = read_robot_state(*experiment.find("start"), robot->description(), errors);
  read.always = read_task(experiment, robot, errors).terms;
  read.q_goal = read.q_start;
  return read;
}

/// Reads a request of a robot that is at `q_now`. Fails with all mistakes in one message.
Result<Goal> read_goal(const GoalRequest& request, const std::shared_ptr<const RobotModel>& robot,
                       const Eigen::VectorXd& q_now) {
  Goal goal;
  goal.id = request.id;
  goal.is_stop = request.wish.is_null();
  if (goal.is_stop) return goal;
  std::vector<Error> errors;
  const auto refuse = [&] {
    std::string all;
    for (const Error& error : errors) all += (all.empty() ? "" : "; ") + error.describe();
    return fail(ErrorCode::kInvalidArgument, std::move(all), "goal " + request.id);
  };
  check_against_schema(request.wish, GoalEntry::parameters().schema(), {}, errors);
  if (!errors.empty()) return refuse();
  goal.q = q_now;
  if (const Node* state = request.wish.find("goal"); state != nullptr && state->is_map()) {
    goal.q = read_robot_state(*state, robot->description(), errors, &q_now);
  }
  goal.task = read_task(request.wish, robot, errors);
  if (!errors.empty()) return refuse();
  return goal;
}

/// While nobody wants anything: how often to ask, and how often what was mapped is forgotten.
constexpr auto kIdle = std::chrono::milliseconds(20);
constexpr double kForget_s = 60.0;

/// Fails where the robot could not be at the goal even if nothing were around it but the floor: it
/// would touch itself, say. What is around it may move, and is not asked.
Result<void> check_possible(const Goal& goal, const std::shared_ptr<const RobotModel>& robot,
                            SpacePolicy space) {
  if (goal.is_stop || goal.task.frees_goal) return {};
  space.unknown = space.outside = Space::kFree;
  const Eigen::AlignedBox3d around_m(-Eigen::Vector3d::Ones(), Eigen::Vector3d::Ones());
  const auto nothing = std::make_shared<const SceneField>(Scene(), Stamp{}, around_m);
  const auto violation = state_violation(robot, nothing, space, 0.0, as_span(goal.q));
  if (!violation) return {};
  return fail(ErrorCode::kInvalidArgument, "the robot cannot be so: " + violation->what(),
              "goal " + goal.id);
}

/// A robot that goes where it is sent, until nobody sends it any more.
class Deployment {
 public:
  Deployment(ExperimentContext& context, DeployConfiguration& settings, ReplanWorld& world,
             GoalSource& goals)
      : context_(context), settings_(settings), world_(world), goals_(goals) {}

  /// One episode a goal, each recorded when it is over.
  Result<void> run(Recorder& recorder) {
    SIDESTEP_TRY(mapping_.attach());
    while (auto goal = wait_for_goal()) {
      if (goal->is_stop) continue;  // it stands already
      const auto done = SIDESTEP_TRY(go_to(*goal));
      record_episode(done, *world_.robot, settings_.deploy.pictures, recorder);
      SIDESTEP_TRY(recorder.commit());
      ++episode_;
      if (mapping_.fault()) return tl::make_unexpected(*mapping_.fault());
      if (settings_.deploy.goals > 0 && episode_ >= settings_.deploy.goals) break;
    }
    mapping_.stop();
    return {};
  }

 private:
  /// Nothing where none will come, or a stop is requested.
  [[nodiscard]] std::optional<Goal> wait_for_goal() {
    show_progress("waiting");
    double idle_s = 0.0;
    while (!context_.stop.stop_requested()) {
      if (waiting_) return std::exchange(waiting_, std::nullopt);
      if (auto goal = next_goal()) return goal;
      if (!goals_.is_open()) return std::nullopt;
      idle();
      idle_s += std::chrono::duration<double>(kIdle).count();
      if (idle_s >= kForget_s) {
        mapping_.stop();
        (void)mapping_.take_record();
        idle_s = 0.0;
      }
    }
    return std::nullopt;
  }

  /// Lets time pass; the map follows, so that it is there when a goal comes.
  void idle() {
    if (settings_.experiment.is_lockstep()) {
      const Stamp now{world_.clock->now().ns + std::chrono::nanoseconds(kIdle).count()};
      world_.clock->set(now);
      (void)world_.measured();
      mapping_.advance(now);
      return;
    }
    world_.clock->start();
    mapping_.start();
    std::this_thread::sleep_for(kIdle);
  }

  /// The newest request, if it makes sense; one that does not is told so.
  [[nodiscard]] std::optional<Goal> next_goal() {
    const std::string executor = plugin_of(world_.executor);
    auto request = call_stage(
        executor, [&]() -> Result<std::optional<GoalRequest>> { return goals_.next_goal(); });
    if (!request) context_.log.warn("no goal: " + request.error().describe());
    if (!request || !*request) return std::nullopt;
    const auto now = world_.measured();
    if (!now) {
      report((*request)->id, State::kRefused,
             "where the robot is, is not known: " + now.error().describe());
      return std::nullopt;
    }
    auto goal = read_goal(**request, world_.robot, now->state.q);
    const auto possible = goal ? check_possible(*goal, world_.robot, settings_.planning.space())
                               : Result<void>(error_of(goal));
    if (possible) return std::move(*goal);
    report((*request)->id, State::kRefused, possible.error().describe());
    return std::nullopt;
  }

  [[nodiscard]] Result<EpisodeRecord> go_to(const Goal& goal) {
    if (const auto now = world_.measured()) world_.q_start = now->state.q;
    world_.q_goal = goal.q;
    Task& task = settings_.task = goal.task;
    task.terms.insert(task.terms.end(), settings_.always.begin(), settings_.always.end());
    report(goal.id, State::kAccepted, "");
    const std::string under_way = "on the way to goal " + goal.id;
    show_progress(under_way);
    next_feedback_ = world_.clock->now();
    auto done = run_episode(
        context_,
        {settings_, world_, mapping_, [&](Stamp now, const Replanner&) { return watch(now, goal); },
         [&](const std::string& how_far) { show_progress(under_way + " (" + how_far + ")"); }},
        episode_);
    if (!done) {
      report(goal.id, State::kFailed, done.error().describe());
    } else if (done->reached) {
      report(goal.id, State::kReached, done->reason);
    } else {
      report(goal.id, done->called_off.empty() ? State::kFailed : State::kReplaced, done->reason,
             farthest_joint());
    }
    return done;
  }

  [[nodiscard]] std::string watch(Stamp now, const Goal& goal) {
    if (auto other = next_goal()) {
      waiting_ = std::move(other);
      return waiting_->is_stop ? "told to stop" : "another goal came: " + waiting_->id;
    }
    if (now >= next_feedback_) {
      next_feedback_ = Stamp::from_seconds(now.seconds() + settings_.deploy.feedback_period_s);
      report(goal.id, State::kActive, "", farthest_joint());
    }
    return {};
  }

  void report(const std::string& id, State state, std::string message, double farthest = 0.0) {
    if (state != State::kActive) {
      context_.log.info("goal " + id + ": " + std::string(to_string(state)) +
                        (message.empty() ? "" : ": " + message));
    }
    const auto told = call_stage(plugin_of(world_.executor), [&]() -> Result<void> {
      goals_.report({id, state, std::move(message), farthest});
      return {};
    });
    if (!told) context_.log.warn("the report was lost: " + told.error().describe());
  }

  /// How many goals are done follows where there are any.
  void show_progress(std::string what) const {
    if (!context_.progress) return;
    if (episode_ > 0) what += "; goals done:";
    context_.progress(episode_, settings_.deploy.goals, what);
  }

  [[nodiscard]] double farthest_joint() {
    const auto now = world_.measured();
    if (!now || now->state.q.size() != world_.q_goal.size()) return 0.0;
    return (world_.q_goal - now->state.q).cwiseAbs().maxCoeff();
  }

  ExperimentContext& context_;
  DeployConfiguration& settings_;
  ReplanWorld& world_;
  GoalSource& goals_;
  EpisodeMapping mapping_{world_, settings_, context_.log, context_.observer};
  std::optional<Goal> waiting_;  ///< Came while the robot was on its way to another.
  Stamp next_feedback_;
  std::int64_t episode_ = 0;
};

class DeployExperiment final : public LoopExperiment {
 public:
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    const auto robot = checked_robot(configuration, host, errors);
    if (robot == nullptr) return;
    (void)read_deploy_configuration(configuration, robot, errors);
    check_loop_names(configuration, robot->description(), errors);
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    const std::shared_ptr<const RobotModel> robot =
        SIDESTEP_TRY(context.host.create<RobotModel>(block_of(context.configuration, "robot")));
    std::vector<Error> errors;
    DeployConfiguration settings = read_deploy_configuration(context.configuration, robot, errors);
    if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
    stand_on_floor(settings.planning, *robot);
    auto world = SIDESTEP_TRY(make_replan_world(context, settings, robot, 0));
    auto* goals = dynamic_cast<GoalSource*>(world.executor.get());
    if (goals == nullptr) {
      return fail(ErrorCode::kConfig, plugin_of(world.executor) + " takes no goals while it runs",
                  block_of(context.configuration, "executor").mark().to_string(),
                  "an experiment of type replan has its goal in the configuration");
    }
    ReplanHead head = replan_head(context, settings, robot->description(), "");
    head.episodes = settings.deploy.goals;
    return run_loop(context, "deploy", head, [&](Recorder& recorder) {
      return Deployment(context, settings, world, *goals).run(recorder);
    });
  }
  [[nodiscard]] Result<ExperimentOutcome> merge(const std::vector<std::filesystem::path>&,
                                                const std::filesystem::path& out) const override {
    return fail(ErrorCode::kUnsupported, "its goals come while it runs", out.string());
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(sidestep::DeployExperiment, sidestep::DeploySettings, "deploy", "0.1.0",
                    "The closed loop to goals that come while it runs, in one map")
