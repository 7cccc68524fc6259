// Problems, planners, checks and proofs.
#include <mutex>

#include <sidestep/certificates/certify.hpp>
#include <sidestep/certificates/polynomial_motion.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/state_cost.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/problems/problem_set.hpp>
#include <sidestep/runtime/motion_planner.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/shape_check.hpp>
#include <sidestep/runtime/standing_floor.hpp>

#include "bindings.hpp"

namespace sidestep::python {
namespace {

using FieldPtr = std::shared_ptr<DistanceField>;

/// A cost that a Python class says: a subclass of sidestep.Cost.
class PythonCost final : public StateCost {
 public:
  explicit PythonCost(py::object self)
      : self_(std::move(self)),
        name_(py::str(self_.attr("name"))),
        residuals_(self_.attr("residual_count").cast<int>()),
        depends_on_velocity_(self_.attr("depends_on_velocity").cast<bool>()) {
    if (residuals_ < 1) throw py::value_error("residual_count has to be 1 or more");
  }
  ~PythonCost() override {
    const py::gil_scoped_acquire lock;
    self_.release().dec_ref();
  }
  PythonCost(const PythonCost&) = delete;
  PythonCost& operator=(const PythonCost&) = delete;

  [[nodiscard]] std::string_view name() const noexcept override { return name_; }
  [[nodiscard]] int residual_count() const noexcept override { return residuals_; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return depends_on_velocity_; }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    const py::gil_scoped_acquire lock;
    const auto copied = [](std::span<const double> values, std::vector<py::ssize_t> shape) {
      return py::array_t<double>(std::move(shape), values.data());
    };
    const py::ssize_t n = states.count, d = states.dof;
    const py::tuple result = self_.attr("evaluate")(
        copied(states.q, {n, d}), copied(states.qdot, {n, d}), copied(states.times_s, {n}));
    const auto write = [&](std::size_t item, std::span<double> into, const char* what,
                           const std::vector<py::ssize_t>& shape) {
      if (into.empty()) return;
      if (item >= result.size()) throw py::value_error("cost '" + name_ + "' returns no " + what);
      const Doubles array = doubles_of(result[item], what);
      if (!std::equal(shape.begin(), shape.end(), array.shape(), array.shape() + array.ndim())) {
        std::string wanted, got;
        for (const auto size : shape)
          wanted += (wanted.empty() ? "" : " x ") + std::to_string(size);
        for (py::ssize_t i = 0; i < array.ndim(); ++i) {
          got += (got.empty() ? "" : " x ") + std::to_string(array.shape(i));
        }
        throw py::value_error("cost '" + name_ + "': " + what + " have to be " + wanted +
                              ", and are " + got);
      }
      std::copy_n(array.data(), into.size(), into.data());
    };
    write(0, out.residuals, "residuals", {n, residuals_});
    write(1, out.jacobian_q, "derivatives by q", {n, residuals_, d});
    if (depends_on_velocity_) {
      write(2, out.jacobian_qdot, "derivatives by qdot", {n, residuals_, d});
    } else {
      std::ranges::fill(out.jacobian_qdot, 0.0);
    }
  }

 private:
  py::object self_;
  std::string name_;
  int residuals_;
  bool depends_on_velocity_;
};

/// An optimiser that a Python class is: a subclass of sidestep.Optimiser.
class PythonOptimiser final : public Optimiser {
 public:
  explicit PythonOptimiser(py::object self) : self_(std::move(self)) {}
  ~PythonOptimiser() override {
    const py::gil_scoped_acquire lock;
    self_.release().dec_ref();
  }
  PythonOptimiser(const PythonOptimiser&) = delete;
  PythonOptimiser& operator=(const PythonOptimiser&) = delete;

  Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                         const Deadline& deadline) override {
    const py::gil_scoped_acquire lock;
    const Stopwatch watch;
    const py::object found = self_.attr("solve")(problem, initial, deadline.remaining_s());
    Solution solution;
    solution.solve_ms = watch.elapsed_ms();
    if (found.is_none()) {
      solution.status = SolveStatus::kNoPath;
      solution.reason = "it found none";
    } else {
      solution.status = SolveStatus::kConverged;
      solution.trajectory = found.cast<Trajectory>();
    }
    return solution;
  }

 private:
  py::object self_;
};

/// What a lane's optimiser is made of: a block, or an object of a Python class.
PluginPtr<Optimiser> make_optimiser(const SessionPtr& session, const RobotPtr& robot,
                                    const py::object& value, const char* key) {
  if (value.is_none()) return nullptr;
  if (py::hasattr(value, "solve")) {
    const std::string name = py::str(py::type::of(value).attr("__name__"));
    return {new PythonOptimiser(value),
            {[](void* object) {
               delete static_cast<PythonOptimiser*>(static_cast<Optimiser*>(object));
             },
             "optimiser " + name}};
  }
  const Node node = block_of(value, key);
  return unlocked(key, [&] { return session->host().create<Optimiser>(node, robot); });
}

/// A planner and what it was made by.
struct Planner {
  Planner(SessionPtr its, RobotPtr moved, MotionPlanner plans)
      : session(std::move(its)), robot(std::move(moved)), planner(std::move(plans)) {}

  SessionPtr session;
  RobotPtr robot;
  MotionPlanner planner;
  std::mutex mutex = {};  ///< To be locked without Python's lock, which costs may wait for.

  RaceResult plan(const FieldPtr& field, const py::object& start, const py::object& goal,
                  double deadline_s, std::uint64_t seed, const std::vector<py::object>& costs) {
    MotionQuery query = query_of(field, start, goal, costs);
    query.seed = seed;
    return unlocked("planning", [&] {
      const std::scoped_lock lock(mutex);
      return planner.plan(query, Deadline::after_s(deadline_s));
    });
  }
  MotionQuery query_of(const FieldPtr& field, const py::object& start, const py::object& goal,
                       const std::vector<py::object>& costs) const {
    if (!field) throw py::value_error("there is no field");
    const RobotDescription& about = robot->description();
    MotionQuery query{field, configuration_of(start, about, "start"),
                      configuration_of(goal, about, "goal")};
    for (const py::object& cost : costs) {
      query.terms.push_back(
          {std::make_shared<PythonCost>(cost), Placement::kSupportAndInterpolated});
    }
    return query;
  }
};

/// Settings for a robot: it stands on the floor where nothing else is said.
PlanningSettings planning_of(const py::object& value, const RobotModel& robot) {
  auto settings = settings_of<PlanningSettings>(value, "planning");
  if (settings.unknown.empty()) settings.unknown = "occupied";
  if (settings.outside.empty()) settings.outside = settings.unknown;
  stand_on_floor(settings, robot);
  return settings;
}

std::shared_ptr<Planner> make_planner(const SessionPtr& session, const RobotPtr& robot,
                                      const py::object& optimiser, const py::object& sampler,
                                      const std::optional<std::vector<std::string>>& seeds,
                                      const py::object& planning, const py::object& check) {
  if (!robot) throw py::value_error("there is no robot");
  std::vector<std::string> guesses = seeds.value_or(std::vector<std::string>());
  if (!seeds && !optimiser.is_none()) guesses.emplace_back("straight");
  if (!seeds && !sampler.is_none()) guesses.emplace_back("sampled");
  if (guesses.empty()) throw py::value_error("a planner needs an optimiser, a sampler or both");
  std::vector<PlanningRace::Lane> lanes;
  for (const std::string& guess : guesses) {
    const bool is_sampled = guess == "sampled";
    if (!is_sampled && guess != "straight") {
      throw py::value_error("no seed is called '" + guess + "': there are straight and sampled");
    }
    if ((is_sampled ? sampler : optimiser).is_none()) {
      throw py::value_error("the seed '" + guess + "' needs " +
                            (is_sampled ? "a sampler" : "an optimiser"));
    }
    lanes.push_back({guess, make_optimiser(session, robot, optimiser, "optimiser"),
                     is_sampled ? make_optimiser(session, robot, sampler, "sampler") : nullptr});
  }
  return std::make_shared<Planner>(
      session, robot,
      MotionPlanner(robot, std::move(lanes), planning_of(planning, *robot),
                    settings_of<CheckSettings>(check, "check")));
}

/// A check and what it needs to live.
struct Check {
  std::shared_ptr<const ValidityCheck> check;
};

Check field_check(const RobotPtr& robot, const FieldPtr& field, const py::object& planning,
                  const py::object& check) {
  return {make_field_check(robot, field, planning_of(planning, *robot).space(),
                           settings_of<CheckSettings>(check, "check").of_field())};
}

Check shape_check(const RobotPtr& robot, const std::shared_ptr<Scene>& scene,
                  const py::object& check) {
  const auto settings = settings_of<CheckSettings>(check, "check");
  ShapeObstacles obstacles;
  obstacles.scene = scene;
  ShapeCheckSettings of_shapes = settings.of_shapes();
  for (const AllowedContactEntry& contact : settings.allowed_contacts) {
    of_shapes.allowed_contacts.push_back(contact);
  }
  return {unlocked("check", [&]() -> Result<std::shared_ptr<const ValidityCheck>> {
    return std::shared_ptr<const ValidityCheck>(
        SIDESTEP_TRY(make_shape_check(robot, obstacles, of_shapes)));
  })};
}

Certification prove(const RobotPtr& robot, const Scene& scene, const Trajectory& trajectory,
                    double margin_m) {
  const auto* tree = dynamic_cast<const KinematicTree*>(robot.get());
  if (tree == nullptr) {
    raise({ErrorCode::kUnsupported,
           "robot '" + robot->description().name +
               "' does not tell its joints, and nothing can be proven of it",
           {},
           {},
           nullptr});
  }
  need(trajectory.validate());
  return unlocked("certify", [&] {
    return certify(*tree, {scene, {}, {}}, polynomials_of(trajectory),
                   {.margin_m = margin_m, .wants_certificate = true});
  });
}

}  // namespace

void bind_planning(py::module_& module, py::class_<Session, SessionPtr>& session) {
  py::class_<Problem>(module, "Problem", "What an optimiser is given.")
      .def_property_readonly("start", [](const Problem& p) { return p.start.q; })
      .def_property_readonly("goal", [](const Problem& p) { return p.goal.q; })
      .def_property_readonly(
          "field", [](const Problem& p) { return std::const_pointer_cast<DistanceField>(p.field); })
      .def_property_readonly(
          "robot", [](const Problem& p) { return std::const_pointer_cast<RobotModel>(p.robot); })
      .def_readonly("support_states", &Problem::support_states)
      .def_readonly("dt_s", &Problem::dt_s, "Between two support states.")
      .def_readonly("collision_margin_m", &Problem::collision_margin_m)
      .def(
          "cost",
          [](const Problem& problem, const Trajectory& trajectory) {
            return unlocked("cost", [&] { return explain(problem, trajectory); }).cost;
          },
          py::arg("trajectory"),
          "Of a trajectory with `support_states` states: the prior's and all terms'.");

  py::class_<RaceResult>(module, "Plan", "A planner's answer; true where there is one.")
      .def_property_readonly(
          "trajectory",
          [](const RaceResult& plan) -> std::optional<Trajectory> {
            if (plan.trajectory.size() == 0) return std::nullopt;
            return plan.trajectory;
          },
          "Timed, and valid by the planner's check; None where there is none.")
      .def_readonly("reason", &RaceResult::reason, "Why there is none.")
      .def_readonly("seed", &RaceResult::seed, "The first guess that led there.")
      .def_readonly("is_smooth", &RaceResult::is_smooth, "It does not stop at corners.")
      .def_readonly("took_ms", &RaceResult::took_ms, "Until there was this answer.")
      .def_property_readonly(
          "first_ms",
          [](const RaceResult& plan) {
            return plan.earlier.empty() ? plan.took_ms : plan.earlier.front().took_ms;
          },
          "Until there was any valid answer.")
      .def_readonly("spent_ms", &RaceResult::spent_ms, "Until the planner ended.")
      .def("__bool__", [](const RaceResult& plan) { return plan.trajectory.size() > 0; });

  py::class_<Planner, std::shared_ptr<Planner>>(
      module, "Planner", "Plans a robot's motions and answers only with what passes its check.")
      .def("plan", &Planner::plan, py::arg("field"), py::arg("start"), py::arg("goal"),
           py::arg("deadline_s") = 5.0, py::arg("seed") = 0,
           py::arg("costs") = std::vector<py::object>(),
           "start, goal: a pose's name, {\"pose\": ..., \"joints\": {...}} or dof values. costs: "
           "objects of classes derived from sidestep.Cost.")
      .def(
          "problem",
          [](const Planner& self, const FieldPtr& field, const py::object& start,
             const py::object& goal, const std::vector<py::object>& costs) {
            Problem problem = self.planner.pose(self.query_of(field, start, goal, costs));
            need(problem.validate());
            return problem;
          },
          py::arg("field"), py::arg("start"), py::arg("goal"),
          py::arg("costs") = std::vector<py::object>(), "What the planner's optimiser is given.");

  py::class_<Verdict>(module, "Verdict", "What a check says; true where a motion is valid.")
      .def("__bool__", &Verdict::valid)
      .def("__str__", &Verdict::describe)
      .def_property_readonly("outcome",
                             [](const Verdict& v) { return std::string(to_string(v.outcome)); })
      .def_readonly("min_clearance_m", &Verdict::min_clearance_m)
      .def_readonly("min_clearance_link", &Verdict::min_clearance_link)
      .def_readonly("min_clearance_time_s", &Verdict::min_clearance_time_s)
      .def_readonly("min_self_clearance_m", &Verdict::min_self_clearance_m)
      .def_property_readonly("violations", [](const Verdict& v) {
        std::vector<std::string> said;
        for (const Violation& violation : v.violations) said.push_back(violation.describe());
        return said;
      });
  py::class_<Check>(module, "Check", "Decides whether a motion is safe, over continuous time.")
      .def(
          "check",
          [](const Check& self, const Trajectory& trajectory, double from_s) {
            return unlocked("check",
                            [&] { return self.check->check(trajectory, from_s, Deadline()); });
          },
          py::arg("trajectory"), py::arg("from_s") = 0.0);

  py::class_<Certification>(module, "Certification",
                            "A proof, or its refutation; true where proven.")
      .def("__bool__",
           [](const Certification& c) { return c.outcome == Certification::Outcome::kProven; })
      .def_property_readonly(
          "outcome", [](const Certification& c) { return std::string(name_of(c.outcome)); },
          "\"proven\", \"refuted\" or \"undecided\".")
      .def_property_readonly(
          "witness",
          [](const Certification& c) -> py::object {
            if (!c.witness) return py::none();
            py::dict witness;
            witness["time_s"] = c.witness->time_s;
            witness["a"] = c.witness->a;
            witness["b"] = c.witness->b;
            witness["distance_m"] = c.witness->distance_m;
            return witness;
          },
          "An instant at which two things are too near, or None.")
      .def_readonly("broken_limit", &Certification::broken_limit)
      .def_readonly("certificate", &Certification::certificate,
                    "The text that `sidestep_recheck` accepts; empty where nothing is proven.");

  py::class_<SetProblem>(module, "SetProblem", "A motion among shapes that stand still.")
      .def_readonly("family", &SetProblem::family)
      .def_readonly("index", &SetProblem::index)
      .def_readonly("start", &SetProblem::q_start)
      .def_readonly("goal", &SetProblem::q_goal)
      .def_property_readonly(
          "scene", [](const SetProblem& p) { return std::const_pointer_cast<Scene>(p.scene); });

  module
      .def("field_check", &field_check, py::arg("robot"), py::arg("field"),
           py::arg("planning") = py::none(), py::arg("check") = py::none(),
           "The check by the robot's spheres in a field.")
      .def("shape_check", &shape_check, py::arg("robot"), py::arg("scene"),
           py::arg("check") = py::none(),
           "The independent check: the robot's own shapes in a scene, by FCL.")
      .def("certify", &prove, py::arg("robot"), py::arg("scene"), py::arg("trajectory"),
           py::arg("margin_m") = 0.0,
           "Proves over continuous time that a motion keeps clear of a scene that stands still and "
           "of "
           "itself, and within limits.")
      .def(
          "read_problem_set",
          [](const std::filesystem::path& from, const RobotPtr& robot) {
            return unlocked("problems",
                            [&] { return read_problem_set(from, robot->description()); });
          },
          py::arg("path"), py::arg("robot"),
          "Every problem of a file or folder, in order (docs/reference/problem_sets.md).");

  session.def("planner", &make_planner, py::arg("robot"), py::arg("optimiser") = py::none(),
              py::arg("sampler") = py::none(), py::arg("seeds") = std::nullopt,
              py::arg("planning") = py::none(), py::arg("check") = py::none(),
              "An optimiser, a sampling planner or both in a race: blocks, or for the optimiser an "
              "object of a class derived from sidestep.Optimiser. planning, check: the blocks of "
              "a configuration.");
}

}  // namespace sidestep::python
