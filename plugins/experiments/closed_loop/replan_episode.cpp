#include "closed_loop.hpp"

#include <algorithm>
#include <array>
#include <random>
#include <set>

#include <sidestep/core/seed.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/runtime/gaze_loop.hpp>
#include <sidestep/runtime/loop_policies.hpp>
#include <sidestep/runtime/step_watch.hpp>

namespace sidestep {
namespace {

/// Between two recorded true states: 125 Hz.
constexpr std::int64_t kTruthPeriod_ns = 8'000'000;
/// How long a robot that has been told to stop at an episode's end is waited for.
constexpr double kLongestStop_s = 5.0;

/// Poses problems from any state to a goal.
Replanner::PoseProblem problems_of(const ReplanConfiguration& settings, const ReplanWorld& world) {
  return [&settings, robot = world.robot](std::shared_ptr<const DistanceField> field,
                                          const RobotState& start, const RobotState& goal) {
    Problem problem = make_problem(robot, std::move(field), settings.planning, start, goal.q);
    problem.space.counts_fixed = false;
    for (const CostTerm& term : settings.task.terms) {
      // Where it ends has been found: the goal's own terms are met there.
      if (term.placement != Placement::kGoal) problem.terms.push_back(term);
    }
    return problem;
  };
}

/// One episode while it runs.
class EpisodeRun {
 public:
  EpisodeRun(ExperimentContext& context, const EpisodeParts& parts, std::int64_t episode)
      : context_(context), parts_(parts) {
    record_.episode = episode;
    record_.begin_s = begin_.seconds();
  }

  Result<EpisodeRecord> run() {
    record_.scene = world_.scene;
    const auto found_goal = find_goal();
    record_.q_goal = world_.q_goal;
    if (!found_goal) {
      record_.reason = found_goal.error().describe();
      return std::move(record_);
    }
    make_replanner();
    if (world_.gaze) {
      gaze_.emplace(SIDESTEP_TRY(GazeLoop::create(
          {world_.robot, *world_.gaze, *world_.executor, *world_.motion, slot_, context_.log,
           plugin_of(world_.gaze), plugin_of(world_.executor), settings_.replanner.margin_m})));
    }
    if (observer_ != nullptr) {
      observer_->begin({context_.configuration.name, record_.episode, world_.robot, world_.scene,
                        world_.q_start, world_.q_goal});
      mapping_.show(true);
    }
    // Whatever happens here, the robot is not left moving.
    const auto done = catch_all("the closed loop", [&]() -> Result<void> {
      if (settings_.experiment.is_lockstep()) {
        run_lockstep();
      } else {
        run_wall();
      }
      return {};
    });
    record_.duration_s = world_.clock->now().seconds() - begin_.seconds();
    come_to_rest();
    mapping_.stop();
    if (!done) return error_of(done);
    record_.reached = status_ == Replanner::Status::kReached;
    record_.q_goal = world_.q_goal = replanner_->goal();
    note_goal_error();
    note_policies();
    record_.checks = replanner_->checks();
    record_.guesses = replanner_->guess_counts();
    static_cast<MappingRecord&>(record_) = mapping_.take_record();
    note_receipts();
    record_.frames = std::ssize(record_.mapping);
    record_.frames_dropped = record_.dropped;
    record_.following = mapping_.following();
    SIDESTEP_TRY(find_truth());
    if (is_certified_) {
      SIDESTEP_TRY(
          certify_motions(*world_.robot, settings_.planning.space(), context_.out, record_));
    }
    judge();
    if (observer_ != nullptr) {
      mapping_.show(false);
      observer_->end({world_.clock->now(),
                      record_.success(),
                      record_.success() ? "the robot is at its goal" : record_.reason,
                      {record_.contacts.begin(), record_.contacts.end()}});
    }
    return std::move(record_);
  }

 private:
  /// The configuration in which the robot does what its task asks of the goal, as the first map has
  /// it.
  [[nodiscard]] Result<void> find_goal() {
    if (!settings_.task.frees_goal) return {};
    if (const auto below = target_below_floor(settings_.task, settings_.planning.floor);
        !below.empty()) {
      return invalid("the goal is not valid: " + below);
    }
    constexpr double kPatience_s = 60.0;
    auto field = slot_.pin();
    if (field == nullptr) field = mapping_.map_first(Deadline::after_s(kPatience_s, context_.stop));
    if (field == nullptr) return fail(ErrorCode::kNotFound, "there is no map to find the goal in");
    const auto deadline = Deadline::after_s(settings_.planning.time_limit_s, context_.stop);
    constexpr int kTries = 8;  // from elsewhere each
    for (int tries = 1;; ++tries) {
      auto q = goal_in(field, deadline);
      const bool is_missed = !q && q.error().code == ErrorCode::kNotFound;
      if (is_missed && tries < kTries && !deadline.expired()) continue;
      world_.q_goal = SIDESTEP_TRY(std::move(q));
      return {};
    }
  }

  /// A configuration in which the robot does what its task asks of the goal, in a map; at each call
  /// looked for from elsewhere.
  [[nodiscard]] Result<Eigen::VectorXd> goal_in(std::shared_ptr<const DistanceField> field,
                                                const Deadline& deadline) {
    PlanningSettings planning = settings_.planning;
    planning.hold_goal = false;
    Eigen::VectorXd from = world_.q_goal;
    if (goals_sought_ > 0) {
      constexpr double kReach = 0.5;  // m, rad: of those that differ at all
      std::mt19937_64 random(derive_seed(world_.seed, "goal/" + std::to_string(goals_sought_)));
      const auto& joints = world_.robot->description().joints;
      for (std::size_t j = 0; j < joints.size(); ++j) {
        double& q = from[static_cast<Eigen::Index>(j)];
        const double lower = std::max(joints[j].lower, q - kReach);
        q = std::uniform_real_distribution(lower, std::min(joints[j].upper, q + kReach))(random);
      }
    }
    ++goals_sought_;
    Problem problem = make_problem(world_.robot, std::move(field), planning, world_.q_start, from);
    problem.terms.insert(problem.terms.end(), settings_.task.terms.begin(),
                         settings_.task.terms.end());
    const auto solution = SIDESTEP_TRY(call_stage(plugin_of(world_.optimiser), [&] {
      return world_.optimiser->solve(problem, straight_line(problem), deadline);
    }));
    if (solution.trajectory.size() == 0) {
      return fail(ErrorCode::kNotFound, "no goal configuration was found: " + solution.reason);
    }
    const auto q = solution.trajectory.q(solution.trajectory.size() - 1);
    if (const std::string miss = goal_miss(problem, q); !miss.empty()) {
      return fail(ErrorCode::kNotFound, "no goal configuration was found: " + miss);
    }
    return Eigen::Map<const Eigen::VectorXd>(q.data(), std::ssize(q));
  }

  void make_replanner() {
    if (settings_.replanner.obstacle_speed_mps > 0.0 && !mapping_.finds_what_moves()) {
      context_.log.warn(plugin_of(world_.mapper) + " offers no view of its " +
                        OccupancyView::kViewName +
                        ": what moves is an obstacle like any other, in spite of "
                        "replanner.obstacle_speed_mps");
    }
    ReplannerSettings settings = settings_.replanner;
    settings.limit_wall_time = !settings_.experiment.is_lockstep();
    settings.seed = world_.seed;
    const auto limits = settings_.planning.limits(world_.robot->description());
    std::optional<LoopPolicies> policies;
    if (settings_.experiment.policies) {
      policies.emplace(world_.robot, limits, settings_.planning.space(), settings);
    }
    judged_.emplace(std::move(policies), world_.mover(), slot_);
    replanner_.emplace(
        Replanner::Parts{world_.robot,
                         judged_->executor(),
                         *world_.optimiser,
                         world_.sampler.get(),
                         slot_,
                         problems_of(settings_, world_),
                         {world_.q_goal, Eigen::VectorXd::Zero(world_.q_goal.size())},
                         settings_.planning.space(),
                         limits,
                         context_.log,
                         plugin_of(world_.executor),
                         plugin_of(world_.optimiser),
                         world_.sampler ? plugin_of(world_.sampler) : "",
                         [this] { return mapping_.trouble(); },
                         world_.predictor.get(),
                         world_.predictor ? plugin_of(world_.predictor) : "",
                         other_goal(),
                         settings_.planning,
                         [this](const Trajectory& motion) {
                           return gaze_ ? gaze_->objection(world_.clock->now(), motion)
                                        : std::string();
                         }},
        settings);
  }

  [[nodiscard]] std::function<std::optional<Eigen::VectorXd>(std::shared_ptr<const DistanceField>)>
  other_goal() {
    if (!settings_.task.frees_goal) return {};
    return [this](std::shared_ptr<const DistanceField> field) -> std::optional<Eigen::VectorXd> {
      const double limit_s = settings_.experiment.is_lockstep() ? settings_.planning.time_limit_s
                                                                : settings_.replanner.solve_limit_s;
      auto q = goal_in(std::move(field), Deadline::after_s(limit_s, context_.stop));
      return q ? std::optional(*std::move(q)) : std::nullopt;
    };
  }

  void run_lockstep() {
    for (Stamp now = begin_;; now.ns += step_.count()) {
      world_.clock->set(now);
      // Brings the robot forward, so that a camera on it knows where it is; what fails, the
      // replanner meets, too.
      (void)world_.measured();
      mapping_.advance(now);
      if (!step(now)) return;
    }
  }

  void run_wall() {
    // A robot maps before it is sent anywhere.
    constexpr double kPatience_s = 1.0;
    if (slot_.pin() == nullptr) mapping_.map_first(Deadline::after_s(kPatience_s, context_.stop));
    world_.clock->start();  // unless it runs
    mapping_.start();
    StepWatch watch(settings_.replanner.longest_step_s(), [this] {
      context_.log.warn("the planning side has not come back: the executor is told to stop");
      const auto stopped =
          call_stage(plugin_of(world_.executor), [&] { return world_.mover().stop(); });
      if (!stopped) context_.log.warn("it does not: " + stopped.error().describe());
    });
    for (bool goes_on = true; goes_on;) {
      const auto begin = std::chrono::steady_clock::now();
      const auto seen = slot_.pin();
      watch.begin();
      goes_on = step(world_.clock->now());
      watch.end();
      slot_.wait_for_newer(seen, begin + step_);
    }
  }

  /// One step of the planning side; false once there is nothing more to do.
  bool step(Stamp now) {
    const std::size_t first = events_.size();
    const Stopwatch watch;
    status_ = judged_->step(*replanner_, now, events_);
    const double step_ms = watch.elapsed_ms();
    if (gaze_ && gaze_->is_due(now)) turn_head(now);
    ++record_.steps;
    note_events(now, first);
    const bool is_last = status_ == Replanner::Status::kReached || now >= end_;
    note_truth(now, is_last);
    if (observer_ != nullptr) show_step(now, step_ms);
    progress_.note(now);
    record_.interrupted = context_.stop.stop_requested();
    if (parts_.watch && !is_last) record_.called_off = parts_.watch(now, *replanner_);
    return !is_last && !record_.interrupted && record_.called_off.empty();
  }

  void turn_head(Stamp now) {
    // A robot that is lost looks around, too.
    const auto current = believed();
    if (current) gaze_->look(now, current->state, replanner_->way());
  }

  /// The episode is over: stops a robot that still moves, and waits until it is at rest.
  void come_to_rest() {
    if (status_ == Replanner::Status::kReached) return;
    const std::size_t first = events_.size();
    Stamp now = world_.clock->now();
    judged_->stop(*replanner_, now, "the episode is over", events_);
    note_events(now, first);
    const Stamp last{now.ns + Stamp::from_seconds(kLongestStop_s).ns};
    while (now < last && !is_at_rest()) {
      if (settings_.experiment.is_lockstep()) {
        world_.clock->set(Stamp{now.ns + step_.count()});
      } else {
        std::this_thread::sleep_for(step_);
      }
      now = world_.clock->now();
      note_truth(now, false);
    }
  }

  /// Where the robot is measured to be, or taken for where its localiser has lost it.
  [[nodiscard]] Result<Executor::Measured> believed() {
    if (!world_.localised) return world_.measured();
    return call_plugin(plugin_of(world_.executor), [&] { return world_.localised->believed(); });
  }

  /// Where that cannot be known, there is nothing to wait for.
  [[nodiscard]] bool is_at_rest() {
    const auto current = believed();
    if (!current || current->state.qdot.size() == 0) return true;
    return !(current->state.qdot.cwiseAbs().maxCoeff() >= settings_.replanner.rest_speed);
  }

  void note_events(Stamp now, std::size_t first) {
    for (std::size_t i = first; i < events_.size(); ++i) {
      EpisodeEvent event{events_[i]};
      if (is_certified_ && begins_motion(event.kind)) {
        record_.moved.push_back(
            {replanner_->followed_start().seconds(), replanner_->followed(), slot_.pin()});
      }
      if (event.kind == ReplannerEvent::Kind::kPlanned ||
          event.kind == ReplannerEvent::Kind::kReplanned) {
        const auto since_map_ms = [&](Stamp stamp) {
          return 1e-6 * static_cast<double>(stamp.ns - event.map_stamp.ns);
        };
        // What the solve took has passed on the wall's clock; in lockstep it is charged.
        const bool is_lockstep = settings_.experiment.is_lockstep();
        event.map_age_ms = since_map_ms(now);
        event.stamp_to_trajectory_ms = since_map_ms(
            is_lockstep ? Stamp::from_seconds(now.seconds() + settings_.replanner.takeover_s)
                        : world_.clock->now());
        record_.followed.push_back(
            {replanner_->followed_start().seconds(), replanner_->followed()});
      }
      if (observer_ != nullptr) show_event(event);
      record_.events.push_back(std::move(event));
    }
  }

  void show_step(Stamp now, double step_ms) {
    ObservedStep step{now, step_ms, status_, replanner_->checks(), {}, {}};
    step.tracks = slot_.snapshot().tracks;
    step.prediction = replanner_->prediction();
    const auto current = world_.measured();
    if (current) step.q = current->state.q;
    if (!record_.poses.empty()) step.q_true = record_.poses.back().q;
    observer_->stepped(step);
  }

  [[nodiscard]] static bool begins_motion(ReplannerEvent::Kind kind) {
    using Kind = ReplannerEvent::Kind;
    const std::array follow = {Kind::kPlanned, Kind::kReplanned, Kind::kStopped, Kind::kSlowed};
    return std::ranges::count(follow, kind) > 0;
  }

  /// A stop is followed, too: every event is shown with what is followed after it.
  void show_event(const EpisodeEvent& event) {
    ObservedEvent shown{event, event.stamp_to_trajectory_ms, nullptr, {}};
    if (begins_motion(event.kind)) {
      shown.followed = std::make_shared<const Trajectory>(replanner_->followed());
      shown.followed_start = replanner_->followed_start();
    }
    observer_->happened(shown);
  }

  /// How long after the receipt of the newest frame in their map trajectories came.
  void note_receipts() {
    for (EpisodeEvent& event : record_.events) {
      if (!event.stamp_to_trajectory_ms) continue;
      const double stamp_s = event.map_stamp.seconds();
      const auto frame = std::ranges::find(record_.mapping, stamp_s, &MappedFrame::stamp_s);
      // One that was mapped before the clock ran was not waited for.
      if (frame == record_.mapping.end() || frame->published_s <= 0.0) continue;
      event.frame_to_trajectory_ms =
          *event.stamp_to_trajectory_ms - 1e3 * (frame->received_s - stamp_s);
    }
  }

  /// What a robot takes for its goal is off by what it takes its place for.
  void note_goal_error() {
    const auto base = BaseJoints::of(*world_.robot);
    if (!record_.reached || !base || record_.poses.empty()) return;
    const Eigen::VectorXd off = record_.poses.back().q - record_.q_goal;
    record_.goal_error_m = std::hypot(off[base->x()], off[base->y()]);
  }

  void note_policies() {
    if (!settings_.experiment.policies) return;
    std::set<std::string_view> broken;
    for (const PolicyBreach& breach : judged_->breaches()) {
      broken.insert(breach.policy);
      context_.log.warn("policy " + std::string(breach.policy) + " is broken at " +
                        std::to_string(breach.stamp.seconds()) + " s: " + breach.what);
    }
    record_.broken_policies = std::ssize(broken);
  }

  void note_truth(Stamp now, bool always) {
    if (world_.true_robot == nullptr || (now < next_truth_ && !always)) return;
    const auto record = [&](Stamp stamp) {
      if (truth_fault_) return;
      auto state = call_stage(plugin_of(world_.executor), [&]() -> Result<RobotState> {
        return world_.true_robot->true_state(stamp);
      });
      if (state) {
        record_.poses.push_back({stamp.seconds(), std::move(state->q), world_.motion->head(stamp)});
      } else {
        truth_fault_ = std::move(state.error());
      }
    };
    // What it did during a step that took long counts, too.
    while (next_truth_.ns + kTruthPeriod_ns < now.ns) {
      record(next_truth_);
      next_truth_.ns += kTruthPeriod_ns;
    }
    record(now);
    next_truth_ = Stamp{now.ns + kTruthPeriod_ns};
  }

  [[nodiscard]] Result<void> find_truth() {
    if (world_.truth != nullptr) {
      // People who see the robot have walked as it went.
      record_.scene = SIDESTEP_TRY(
          call_stage(plugin_of(world_.source), [&]() -> Result<std::shared_ptr<const Scene>> {
            return world_.truth->scene_until(world_.clock->now());
          }));
    }
    if (record_.scene == nullptr || record_.poses.empty()) return {};
    TrueMotionSettings truth;
    const auto& allowed = settings_.check.allowed_contacts;
    truth.allowed_contacts.assign(allowed.begin(), allowed.end());
    record_.truth =
        SIDESTEP_TRY(check_true_motion(world_.robot, record_.scene, record_.poses, truth));
    for (const TrueContact& contact : record_.truth.contacts) {
      record_.contacts.push_back(
          {contact, cause_of(contact, record_, settings_.replanner.rest_speed)});
    }
    return {};
  }

  /// Why the episode is no success, if it is none: what weighs most.
  void judge() {
    const auto own = std::ranges::find_if(record_.contacts, &TrueContact::is_by_robot);
    if (own != record_.contacts.end()) {
      record_.reason =
          "link '" + own->link + "' touched '" + own->object + "' (" + own->cause + ")";
    } else if (truth_fault_) {
      record_.reason = "what the robot touched is not known: " + truth_fault_->describe();
    } else if (!judged_->breaches().empty()) {
      const PolicyBreach& first = judged_->breaches().front();
      record_.reason = "policy " + std::string(first.policy) + " is broken: " + first.what;
    } else if (record_.interrupted) {
      record_.reason = "interrupted";
    } else if (!record_.called_off.empty()) {
      record_.reason = record_.called_off;
    } else if (mapping_.fault()) {
      record_.reason = mapping_.fault()->describe();
    } else if (!record_.reached) {
      record_.reason = "the goal was not reached in time";
      const auto is_stop = [](const EpisodeEvent& event) {
        return event.kind == ReplannerEvent::Kind::kStopped ||
               event.kind == ReplannerEvent::Kind::kReplanFailed;
      };
      const auto last = std::find_if(record_.events.rbegin(), record_.events.rend(), is_stop);
      if (last != record_.events.rend()) record_.reason += "; last: " + last->cause;
    }
  }

  ExperimentContext& context_;
  const EpisodeParts& parts_;
  const ReplanConfiguration& settings_ = parts_.settings;
  const bool is_certified_ = parts_.is_certified && settings_.check.wants_certificate();
  ReplanWorld& world_ = parts_.world;
  SnapshotSlot& slot_ = *parts_.world.slot;
  EpisodeMapping& mapping_ = parts_.mapping;
  RunObserver* observer_ = context_.observer;  ///< May be null.
  std::optional<JudgedLoop> judged_;           ///< Nothing where nobody looks at policies.
  std::optional<Replanner> replanner_;
  std::optional<GazeLoop> gaze_;  ///< Nothing where the head rests.
  Stamp begin_ = world_.clock->now();
  EpisodeProgress progress_{parts_.progress, begin_, settings_.experiment.duration_s};
  Stamp end_ = Stamp::from_seconds(begin_.seconds() + settings_.experiment.duration_s);
  const std::chrono::nanoseconds step_{Stamp::from_seconds(settings_.experiment.step_s).ns};
  Stamp next_truth_ = begin_;
  std::vector<ReplannerEvent> events_;
  std::optional<Error> truth_fault_;  ///< After it, no truth is recorded.
  EpisodeRecord record_;
  int goals_sought_ = 0;
  Replanner::Status status_ = Replanner::Status::kWaiting;
};

}  // namespace

Result<EpisodeRecord> run_episode(ExperimentContext& context, const EpisodeParts& parts,
                                  std::int64_t episode) {
  return EpisodeRun(context, parts, episode).run();
}

}  // namespace sidestep
