// Closed loops that Python steps, with robots that Python moves.
#include <mutex>

#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/replanner.hpp>

#include "bindings.hpp"

namespace sidestep::python {
namespace {

/// A robot that a Python class moves: a subclass of sidestep.Executor.
class PythonExecutor final : public Executor {
 public:
  explicit PythonExecutor(py::object self) : self_(std::move(self)) {}

  Result<Measured> current() override {
    const py::gil_scoped_acquire lock;
    const py::object state = called(self_.get(), "current");
    if (!py::isinstance<py::tuple>(state) || py::len(state) != 3) {
      throw py::type_error("current() has to return positions, velocities and a time");
    }
    const py::tuple items = state;
    return Measured{{values_of(items[0], "positions"), values_of(items[1], "velocities")},
                    Stamp::from_seconds(items[2].cast<double>())};
  }
  Result<void> follow(const Trajectory& trajectory, Stamp start) override {
    const py::gil_scoped_acquire lock;
    called(self_.get(), "follow", trajectory, start.seconds());
    return {};
  }
  Result<void> stop() override {
    const py::gil_scoped_acquire lock;
    called(self_.get(), "stop");
    return {};
  }

 private:
  static Eigen::VectorXd values_of(const py::handle& value, const char* what) {
    const Doubles array = doubles_of(value, what);
    if (array.ndim() != 1) throw py::value_error(std::string(what) + " are one array");
    return Eigen::Map<const Eigen::VectorXd>(array.data(), array.shape(0));
  }

  Held self_;
};

/// Says nothing: what happens is in the events.
class QuietLog final : public Log {
 public:
  void write(LogLevel, std::string_view) override {}
};

/// What a loop is made of; the replanner goes first.
struct LoopParts {
  SessionPtr session;
  RobotPtr robot;
  PlanningSettings planning;
  PluginPtr<Executor> executor;
  PluginPtr<Optimiser> optimiser, sampler;
  QuietLog log = {};
  SnapshotSlot slot = {};
};

/// A replanner that Python steps.
class Loop {
 public:
  Loop(std::unique_ptr<LoopParts> its, const Eigen::VectorXd& q_goal,
       const ReplannerSettings& settings)
      : parts_(std::move(its)), replanner_(parts_of(*parts_, q_goal), settings) {}

  std::vector<ReplannerEvent> step(double now_s, const std::shared_ptr<DistanceField>& field) {
    return unlocked("loop", [&]() -> Result<std::vector<ReplannerEvent>> {
      const auto lock = SIDESTEP_TRY(alone_.enter("a loop cannot be stepped by its own robot"));
      if (field) parts_->slot.publish(field);
      std::vector<ReplannerEvent> events;
      status_ = replanner_.step(Stamp::from_seconds(now_s), events);
      return events;
    });
  }
  std::vector<ReplannerEvent> stop(double now_s, const std::string& cause) {
    return unlocked("loop", [&]() -> Result<std::vector<ReplannerEvent>> {
      const auto lock = SIDESTEP_TRY(alone_.enter("a loop cannot be stopped by its own robot"));
      std::vector<ReplannerEvent> events;
      replanner_.stop(Stamp::from_seconds(now_s), cause, events);
      return events;
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
  static Replanner::Parts parts_of(LoopParts& parts, const Eigen::VectorXd& q_goal) {
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
            .sampler_name = parts.sampler ? plugin_of(parts.sampler) : ""};
  }

  std::unique_ptr<LoopParts> parts_;
  Replanner replanner_;
  Replanner::Status status_ = Replanner::Status::kWaiting;
  Alone alone_;
};

std::shared_ptr<Loop> make_loop(const SessionPtr& session, const RobotPtr& robot,
                                const py::object& executor, const py::object& optimiser,
                                const py::object& goal, const py::object& sampler,
                                const py::object& planning, const py::object& replanner,
                                bool wall_clock) {
  for (const char* const method : {"current", "follow", "stop"}) {
    if (!py::hasattr(executor, method)) {
      throw py::type_error("the executor has no " + std::string(method) + "()");
    }
  }
  if (optimiser.is_none()) throw py::type_error("a loop needs an optimiser");
  auto settings = settings_of<ReplannerSettings>(replanner, "replanner");
  settings.limit_wall_time = wall_clock;
  const Eigen::VectorXd q_goal = configuration_of(goal, robot->description(), "goal");
  std::unique_ptr<LoopParts> parts(
      new LoopParts{session, robot, planning_of(planning, *robot),
                    made_of<Executor, PythonExecutor>(executor, "executor"),
                    make_optimiser(session, robot, optimiser, "optimiser"),
                    make_optimiser(session, robot, sampler, "sampler")});
  return std::make_shared<Loop>(std::move(parts), q_goal, settings);
}

}  // namespace

void bind_loops(py::module_& module, py::class_<Session, SessionPtr>& session) {
  using Event = ReplannerEvent;
  py::class_<Event>(module, "Event", "Something that a loop did or saw.")
      .def_property_readonly("kind",
                             [](const Event& event) { return std::string(to_string(event.kind)); })
      .def_property_readonly(
          "reason", [](const Event& event) { return std::string(to_string(event.reason)); },
          "The category of `cause`.")
      .def_property_readonly("stamp_s", [](const Event& event) { return event.stamp.seconds(); })
      .def_readonly("cause", &Event::cause, "Why, in words.")
      .def_readonly("guess", &Event::guess, "The first guess that led to a trajectory.")
      .def_readonly("tried", &Event::tried, "First guesses that were tried, in order.")
      .def_readonly("solve_ms", &Event::solve_ms, "Of plans and replans: all attempts.")
      .def("__repr__", [](const Event& event) {
        return "<" + std::string(to_string(event.kind)) + " at " +
               std::to_string(event.stamp.seconds()) + " s: " + event.cause + ">";
      });

  py::class_<Loop, std::shared_ptr<Loop>>(
      module, "Loop",
      "A robot on its way to a goal: what it follows is checked in every new map, replanned where "
      "something is in the way, and stopped where nothing else is left (docs/closed_loop.md).")
      .def("step", &Loop::step, py::arg("now_s"), py::arg("field") = nullptr,
           "Does what is due, at 250 Hz or better, in the newest map; `field` is a new one. What "
           "happened.")
      .def("stop", &Loop::stop, py::arg("now_s"), py::arg("cause"),
           "Brings the robot to rest, instead of a last step.")
      .def_property_readonly("status", &Loop::status,
                             "After a step: \"moving\", \"waiting\" or \"reached\".");

  session.def("loop", &make_loop, py::arg("robot").none(false), py::arg("executor"),
              py::arg("optimiser"), py::arg("goal"), py::arg("sampler") = py::none(),
              py::arg("planning") = py::none(), py::arg("replanner") = py::none(),
              py::arg("wall_clock") = false,
              "A closed loop. executor: an object of a class derived from sidestep.Executor. "
              "planning, replanner: the blocks of a configuration. wall_clock: whether time goes "
              "on while it plans, so that what takes too long counts; else equal steps lead to "
              "equal events.");
}

}  // namespace sidestep::python
