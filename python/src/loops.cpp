// Closed loops that Python steps, with robots that Python moves.
#include <mutex>

#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/runtime/gaze_loop.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/replanner.hpp>
#include <sidestep/runtime/step_watch.hpp>

#include "bindings.hpp"

namespace sidestep::python {
namespace {

/// A robot that a Python class moves: a subclass of sidestep.Executor.
class PythonExecutor : public Executor {
 public:
  explicit PythonExecutor(py::object self) : self_(std::move(self)) {}

  Result<Measured> current() override {
    const Locked lock;
    const py::object state = called(self_.get(), "current");
    if (!py::isinstance<py::tuple>(state) || py::len(state) != 3) {
      throw py::type_error("current() has to return positions, velocities and a time");
    }
    const py::tuple items = state;
    return Measured{{values_of(items[0], "positions"), values_of(items[1], "velocities")},
                    stamp_of(items[2].cast<double>(), "the time that current() returns")};
  }
  Result<void> follow(const Trajectory& trajectory, Stamp start) override {
    const Locked lock;
    called(self_.get(), "follow", trajectory, start.seconds());
    return {};
  }
  Result<void> stop() override {
    const Locked lock;
    called(self_.get(), "stop");
    return {};
  }

 protected:
  [[nodiscard]] const py::object& self() const noexcept { return self_.get(); }

 private:
  static Eigen::VectorXd values_of(const py::handle& value, const char* what) {
    const Doubles array = doubles_of(value, what);
    if (array.ndim() != 1) throw py::value_error(std::string(what) + " are one array");
    return Eigen::Map<const Eigen::VectorXd>(array.data(), array.shape(0));
  }

  Held self_;
};

/// The same of a robot with a head.
class PythonHead final : public PythonExecutor, public HeadTurner {
 public:
  PythonHead(const py::object& self, Fault& fault)
      : PythonExecutor(self), name_(name_of(self, "executor")), fault_(fault) {}

  Result<void> turn_head(const HeadAngles& to) override {
    return noted(fault_, name_, [&]() -> Result<void> {
      const Locked lock;
      called(self(), "turn_head", to.pan_rad, to.tilt_rad);
      return {};
    });
  }
  Result<HeadAngles> head() {
    return noted(fault_, name_, [&]() -> Result<HeadAngles> {
      const Locked lock;
      return angles_of(called(self(), "head"), "head");
    });
  }

 private:
  std::string name_;
  Fault& fault_;
};

/// Says nothing: what happens is in the events, and what goes wrong in Python is raised.
class QuietLog final : public Log {
 public:
  void write(LogLevel, std::string_view) override {}
};

/// What a loop is made of; the replanner goes first.
struct LoopParts {
  SessionPtr session;
  RobotPtr robot;
  PlanningSettings planning;
  QuietLog log = {};
  SnapshotSlot slot = {};
  RobotMotion motion = RobotMotion();  ///< Has the head alone.
  Fault fault = {};
  PluginPtr<Executor> executor = {};
  PluginPtr<Optimiser> optimiser = {}, sampler = {};
  PluginPtr<Predictor> predictor = {};
  PluginPtr<Gaze> gaze = {};
};

/// A replanner that Python steps.
class Loop {
 public:
  Loop(std::unique_ptr<LoopParts> its, const Eigen::VectorXd& q_goal,
       const ReplannerSettings& settings)
      : parts_(std::move(its)),
        replanner_(parts_of(q_goal), settings),
        fears_motion_(settings.obstacle_speed_mps > 0.0 || settings.safety == "ssm") {
    LoopParts& parts = *parts_;
    if (parts.gaze) {
      gaze_.emplace(need(GazeLoop::create({parts.robot, *parts.gaze, *parts.executor, parts.motion,
                                           parts.slot, parts.log, plugin_of(parts.gaze),
                                           plugin_of(parts.executor), settings.margin_m})));
    }
    if (!settings.limit_wall_time) return;
    watch_.emplace(settings.longest_step_s(), [&parts] {
      (void)call_stage(plugin_of(parts.executor), [&] { return parts.executor->stop(); });
    });
  }
  /// Whoever watches may be in Python.
  ~Loop() {
    const Unlocked release;
    watch_.reset();
  }

  std::vector<ReplannerEvent> step(double now_s, const SnapshotPtr& seen) {
    const Stamp now = stamp_of(now_s, "now_s");
    return unlocked("loop", [&]() -> Result<std::vector<ReplannerEvent>> {
      const auto lock = SIDESTEP_TRY(
          alone_.enter("a loop cannot be stepped by its own robot, predictor or gaze"));
      if (seen) SIDESTEP_TRY(check(*seen));
      if (seen) parts_->slot.publish(seen->map);
      now_ = now;
      if (watch_) watch_->begin();
      status_ = replanner_.step(now_, events_);
      if (gaze_ && gaze_->is_due(now_)) turn_head();
      if (watch_) watch_->end();
      if (auto fault = std::exchange(parts_->fault, {})) return tl::make_unexpected(*fault);
      return std::exchange(events_, {});
    });
  }
  std::vector<ReplannerEvent> stop(double now_s, const std::string& cause) {
    const Stamp now = stamp_of(now_s, "now_s");
    return unlocked("loop", [&]() -> Result<std::vector<ReplannerEvent>> {
      const auto lock = SIDESTEP_TRY(
          alone_.enter("a loop cannot be stopped by its own robot, predictor or gaze"));
      now_ = now;
      replanner_.stop(now_, cause, events_);
      return std::exchange(events_, {});
    });
  }
  std::optional<std::vector<PredictedSet>> prediction() {
    return unlocked("loop", [&]() -> Result<std::optional<std::vector<PredictedSet>>> {
      const auto lock =
          SIDESTEP_TRY(alone_.enter("a loop cannot be asked by its own robot, predictor or gaze"));
      const auto prediction = replanner_.prediction();
      return prediction ? std::optional(prediction->sets()) : std::nullopt;
    });
  }
  [[nodiscard]] std::string status() const {
    switch (status_) {
      case Replanner::Status::kMoving: return "moving";
      case Replanner::Status::kWaiting: return "waiting";
      case Replanner::Status::kReached: return "reached";
    }
    return "";
  }

 private:
  /// What is left out of a map has to be predicted, and whoever goes by what moves has to be told.
  [[nodiscard]] Result<void> check(const Snapshot& seen) const {
    const auto& predictor = parts_->predictor;
    using Subject = PredictionSubject;
    const Subject subject = predictor ? predictor->subject() : Subject::kNothing;
    if (seen.is_apart && subject == Subject::kNothing) {
      return invalid("what is tracked is not in this map's field, and the loop predicts nothing");
    }
    const bool lacks_tracks = seen.map.tracks == nullptr;
    if (lacks_tracks && subject == Subject::kTracks) {
      return invalid(plugin_of(predictor) + " has no tracks: map with motion=\"apart\"");
    }
    if (lacks_tracks && parts_->gaze && parts_->gaze->wants_tracks()) {
      return invalid(plugin_of(parts_->gaze) + " has no tracks: map with motion=\"tracked\"");
    }
    if (lacks_tracks && fears_motion_ && seen.map.moving == nullptr) {
      return invalid(
          "this map does not tell what moves, and the replanner goes by it: map with "
          "motion=\"detected\", or \"tracked\" for safety: ssm");
    }
    return {};
  }
  void turn_head() {
    auto* const head = dynamic_cast<PythonHead*>(parts_->executor.get());
    const auto at = head->head();
    if (at) parts_->motion.record_head(*at, now_);
    const auto current = call_stage(plugin_of(parts_->executor), [&] { return head->current(); });
    if (at && current) gaze_->look(now_, current->state, replanner_.way());
  }
  Replanner::Parts parts_of(const Eigen::VectorXd& q_goal) {
    LoopParts& parts = *parts_;
    const auto pose = [&parts](std::shared_ptr<const DistanceField> field, const RobotState& start,
                               const RobotState& goal) {
      Problem problem = make_problem(parts.robot, std::move(field), parts.planning, start, goal.q);
      problem.space.counts_fixed = false;
      return problem;
    };
    return {.robot = parts.robot,
            .executor = *parts.executor,
            .optimiser = *parts.optimiser,
            .sampler = parts.sampler.get(),
            .slot = parts.slot,
            .pose_problem = pose,
            .goal = {q_goal, Eigen::VectorXd::Zero(q_goal.size())},
            .space = parts.planning.space(),
            .limits = parts.planning.limits(parts.robot->description()),
            .log = parts.log,
            .executor_name = plugin_of(parts.executor),
            .optimiser_name = plugin_of(parts.optimiser),
            .sampler_name = parts.sampler ? plugin_of(parts.sampler) : "",
            .predictor = parts.predictor.get(),
            .predictor_name = parts.predictor ? plugin_of(parts.predictor) : "",
            .moving_costs = parts.planning,
            .objection = [this](const Trajectory& motion) {
              return gaze_ ? gaze_->objection(now_, motion) : std::string();
            }};
  }

  std::unique_ptr<LoopParts> parts_;
  Replanner replanner_;
  bool fears_motion_;
  std::optional<GazeLoop> gaze_;
  std::optional<StepWatch> watch_;  ///< Where time goes on during a step.
  Stamp now_;
  Replanner::Status status_ = Replanner::Status::kWaiting;
  std::vector<ReplannerEvent> events_;  ///< Not told yet.
  Alone alone_;
};

std::shared_ptr<Loop> make_loop(const SessionPtr& session, const RobotPtr& robot,
                                const py::object& executor, const py::object& optimiser,
                                const py::object& goal, const py::object& sampler,
                                const py::object& planning, const py::object& replanner,
                                bool wall_clock, const py::object& predictor,
                                const py::object& gaze) {
  need_object(executor, "Executor", {});
  for (const char* const method : {"current", "follow", "stop", "head", "turn_head"}) {
    const bool is_of_head = std::string_view(method).ends_with("head");
    if (!py::hasattr(executor, method) && (!is_of_head || !gaze.is_none())) {
      throw py::type_error("the executor has no " + std::string(method) + "()");
    }
  }
  if (optimiser.is_none()) throw py::type_error("a loop needs an optimiser");
  auto settings = settings_of<ReplannerSettings>(replanner, "replanner");
  settings.limit_wall_time = wall_clock;
  const Eigen::VectorXd q_goal = configuration_of(goal, robot->description(), "goal");
  std::unique_ptr<LoopParts> parts(new LoopParts{session, robot, planning_of(planning, *robot)});
  parts->executor = gaze.is_none()
                        ? made_of<Executor, PythonExecutor>(executor, "executor")
                        : made_of<Executor, PythonHead>(executor, "executor", parts->fault);
  parts->optimiser = make_optimiser(session, robot, optimiser, "optimiser");
  parts->sampler = make_optimiser(session, robot, sampler, "sampler");
  parts->predictor = make_predictor(session, robot, predictor, parts->slot, parts->fault);
  parts->gaze = make_gaze(session, robot, gaze, parts->slot, parts->fault);
  return std::make_shared<Loop>(std::move(parts), q_goal, settings);
}

}  // namespace

void bind_loops(py::module_& module, py::class_<Session, SessionPtr>& session) {
  using Event = ReplannerEvent;
  py::class_<Event>(module, "Event", "Something that a loop did or saw.")
      .def_property_readonly(
          "kind", [](const Event& event) { return std::string(to_string(event.kind)); },
          "\"planned\", \"replanned\", \"replan_failed\", \"slowed\", \"stopped\", "
          "\"recovered\" or \"reached\".")
      .def_property_readonly(
          "reason", [](const Event& event) { return std::string(to_string(event.reason)); },
          "The category of `cause`.")
      .def_property_readonly(
          "stamp_s", [](const Event& event) { return event.stamp.seconds(); },
          "When, in s, on the clock of Loop.step().")
      .def_readonly("cause", &Event::cause, "Why, in words.")
      .def_readonly("guess", &Event::guess, "The first guess that led to a trajectory.")
      .def_readonly("tried", &Event::tried, "First guesses that were tried, in order.")
      .def_readonly("solve_ms", &Event::solve_ms,
                    "Of plans and replans: all attempts, wall time in ms.")
      .def("__repr__", [](const Event& event) {
        return "<" + std::string(to_string(event.kind)) + " at " +
               std::to_string(event.stamp.seconds()) + " s: " + event.cause + ">";
      });

  py::class_<Loop, std::shared_ptr<Loop>>(
      module, "Loop",
      "A robot on its way to a goal: what it follows is checked in every new map, replanned where "
      "something is in the way, and stopped where nothing else is left (docs/closed_loop.md).")
      .def("step", &Loop::step, py::arg("now_s"), py::arg("field") = nullptr,
           "Does what is due, at 250 Hz or better, in the newest map; `field` is a new one, a "
           "DistanceField or, with what is tracked, a Snapshot. What happened. What a predictor, a "
           "gaze or a head in Python does amiss is raised once the step is done.")
      .def("stop", &Loop::stop, py::arg("now_s"), py::arg("cause"),
           "Brings the robot to rest, instead of a last step.")
      .def_property_readonly("prediction", &Loop::prediction,
                             "Where what is tracked in the newest map may be, a list of "
                             "PredictedSet; None where nothing is predicted.")
      .def_property_readonly("status", &Loop::status,
                             "After a step: \"moving\", \"waiting\" or \"reached\".");

  session.def("loop", &make_loop, py::arg("robot").none(false), py::arg("executor"),
              py::arg("optimiser"), py::arg("goal"), py::arg("sampler") = py::none(),
              py::arg("planning") = py::none(), py::arg("replanner") = py::none(),
              py::arg("wall_clock") = false, py::arg("predictor") = py::none(),
              py::arg("gaze") = py::none(),
              "A closed loop. executor: an object of a class derived from sidestep.Executor. "
              "planning, replanner: the blocks of a configuration. wall_clock: whether time goes "
              "on while it plans, so that what takes too long counts, and the robot is stopped "
              "where a step does not come back; else equal steps lead to equal events. predictor, "
              "gaze: blocks, or objects of classes derived from sidestep.Predictor or "
              "sidestep.Gaze.");
}

}  // namespace sidestep::python
